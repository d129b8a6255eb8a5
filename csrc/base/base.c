/* SPDX-License-Identifier: MIT
 *
 * Errors and memory. The only file that asks the heap; tests build it with BD_MALLOC and BD_FREE
 * defined to make every allocation fail in turn (tests/c/test_memory.c).
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/base.h"

#ifndef BD_MALLOC
#define BD_MALLOC malloc
#define BD_FREE free
#else
void *BD_MALLOC(size_t size);
void BD_FREE(void *block);
#endif

void *bd_carve(bd_carver *carver, size_t count, size_t size) {
  void *piece = carver->base ? carver->base + carver->used : NULL;
  carver->used += (count * size + BD_ALIGN - 1) / BD_ALIGN * BD_ALIGN;
  return piece;
}

void bd_keep(bd_carver *carver, bd_kept kept) {
  if (carver->kept) {
    carver->kept[carver->n_kept] = kept;
  }
  ++carver->n_kept;
}

uint64_t bd_check_sum(uint64_t sum, const void *data, size_t size) {
  const unsigned char *byte = data;
  for (size_t k = 0; k < size; ++k) {
    sum = (sum ^ byte[k]) * 0x100000001b3u;
  }
  return sum;
}

void bd_given(bd_carver *carver, const void *data, size_t size) {
  carver->given = carver->base ? bd_check_sum(carver->given, data, size) : 0;
}

const double *bd_carve_copy(bd_carver *carver, const double *given, size_t count) {
  double *copy = bd_carve(carver, count, sizeof *copy);
  bd_given(carver, given, count * sizeof *copy);
  if (copy && count > 0) {
    memcpy(copy, given, count * sizeof *copy);
  }
  return copy;
}

void bd_carve_links(bd_carver *carver, const bd_layout *lay, double **block) {
  bd_carve_rows(carver, lay, 1, block);
}

void bd_carve_rows(bd_carver *carver, const bd_layout *lay, int count, double **rows) {
  BD_CARVE(carver, *rows, count * lay->stride);
  *rows = count == 0 ? NULL : carver->base ? *rows + BD_HALO : *rows;
}

/* aligned_alloc is missing or partial on some platforms: align by hand, keep the heap's own pointer
 * just before the block. */
void *bd_block_new(size_t size) {
  char *raw = BD_MALLOC(size + BD_ALIGN + sizeof(void *));
  if (!raw) {
    return NULL;
  }
  uintptr_t start = (uintptr_t)raw + sizeof(void *);
  start = (start + BD_ALIGN - 1) / BD_ALIGN * BD_ALIGN;
  char *block = raw + (start - (uintptr_t)raw);
  memcpy(block - sizeof(void *), &raw, sizeof raw);
  memset(block, 0, size);
  return block;
}

void bd_block_free(void *block) {
  if (block) {
    void *raw;
    memcpy(&raw, (char *)block - sizeof(void *), sizeof raw);
    BD_FREE(raw);
  }
}

/* A message that has been cut off must not end inside a character of UTF-8. */
static void write_message(char *message, size_t size, const char *format, va_list args) {
  const int length = vsnprintf(message, size, format, args);
  if (length < (int)size) {
    return;
  }
  size_t end = size - 1;
  while (end > 0 && ((unsigned char)message[end - 1] & 0xC0) == 0x80) {
    --end;
  }
  message[end > 0 && (unsigned char)message[end - 1] >= 0xC0 ? end - 1 : size - 1] = '\0';
}

static int fail(bd_error *err, int code, const char *field, double t, int body, int pulley,
                double value, const char *format, va_list args) {
  if (err) {
    memset(err, 0, sizeof *err);
    err->code = code;
    err->t = t;
    err->body = body;
    err->pulley = pulley;
    err->value = value;
    snprintf(err->field, sizeof err->field, "%s", field);
    write_message(err->message, sizeof err->message, format, args);
  }
  return code;
}

int bd_fail(bd_error *err, int code, const char *field, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fail(err, code, field, (double)NAN, -1, -1, (double)NAN, format, args);
  va_end(args);
  return code;
}

int bd_fail_at(bd_error *err, int code, const char *field, double t, int body, int pulley,
               double value, const char *format, ...) {
  va_list args;
  va_start(args, format);
  fail(err, code, field, t, body, pulley, value, format, args);
  va_end(args);
  return code;
}

void bd_warn(bd_report *report, int code, double t, int body, int pulley, const char *format, ...) {
  bd_warning *w = &report->warned[code];
  if (w->message[0]) {
    return;
  }
  *w = (bd_warning){.code = code, .t = t, .body = body, .pulley = pulley};
  va_list args;
  va_start(args, format);
  write_message(w->message, sizeof w->message, format, args);
  va_end(args);
}

static const struct {
  const char *symbol, *text;
  int kind;
} errors[] = {
#define X(symbol, kind, text) {#symbol, text, BD_KIND_##kind},
    BD_ERRORS(X)
#undef X
};

static const struct {
  const char *code;
  int accuracy;
} warnings[] = {
#define X(code, accuracy, text) {#code, accuracy},
    BD_WARNINGS(X)
#undef X
};

const char *bd_warning_code(int code) {
  return code >= 0 && code < BD_N_WARNINGS ? warnings[code].code : "unknown";
}

int bd_warning_accuracy(int code) {
  return code >= 0 && code < BD_N_WARNINGS && warnings[code].accuracy;
}

static int row_of(int code) {
  int row = code - BD_ERR_FIRST - 1;
  return row >= 0 && row < (int)(sizeof errors / sizeof errors[0]) ? row : -1;
}

const char *bd_error_symbol(int code) {
  int row = row_of(code);
  return row < 0 ? (code == BD_OK     ? "BD_OK"
                    : code == BD_MORE ? "BD_MORE"
                                      : "unknown")
                 : errors[row].symbol;
}

const char *bd_error_text(int code) {
  int row = row_of(code);
  return row < 0 ? "no error" : errors[row].text;
}

int bd_error_kind(int code) {
  int row = row_of(code);
  return row < 0 ? BD_KIND_USE : errors[row].kind;
}
