/* SPDX-License-Identifier: MIT
 *
 * What everything stands on: memory in blocks, errors, the layout of the state vector.
 *
 * Layout. One flat, 64-byte aligned vector: LINK_FIELDS blocks of `stride` doubles, then a tail
 *
 *   | x | y | phi | vx | vy | vphi | m | v | mu (slots, states) | slip (slots) || theta | omega |
 *   parts | work |
 *
 * Of those before mu, and of slip, a belt has those of its model, one after the other.
 * In a block link i stands at BD_HALO + i; what stands before link 0 and after link n-1 is padding,
 * kept at rest.
 * Positions are relative to the model's origin and phi to `turns` whole turns, so neither a far
 * scene nor a belt that has circulated for long costs digits of stretch.
 */
#ifndef BELTDYN_BASE_H
#define BELTDYN_BASE_H

#include <math.h>

#include "beltdyn.h"

#define BD_PI 3.14159265358979323846
#define BD_HALO 8
#define BD_LANES 8 /* blocks are padded to the widest vector */
#define BD_ALIGN 64

/* Rows of BD_STATE_FIELDS; of a field of links its block is bd_block, F_MU the
 * first of the friction slots' states (bd_f_state). */
enum {
#define X(symbol, name, size, scale, unit, text) F_##symbol,
  BD_STATE_FIELDS(X)
#undef X
      BD_N_FIELDS
};

/* Work integrals carried in the tail: rows of BD_ENERGY_TERMS. Those of effects that not every
 * drive has come last; n_work of the layout says how many there are. */
enum {
#define X(name, kind, text) BD_WORK_##kind(W_##name, )
  BD_ENERGY_TERMS(X)
#undef X
      MAX_WORK
};

typedef struct bd_layout {
  int n, n8, np, slots;
  unsigned fields;     /* of the belt, that it has: a bit each, */
  int block[F_MU + 1]; /* and the numbers of their blocks; of the first one of friction */
  int states;          /* of friction, of a link in a slot: the most that a law has */
  int stride;          /* doubles per block */
  union {              /* where each row of BD_STATE_FIELDS begins, by number and by name */
    int offset[BD_N_FIELDS];
    struct {
#define X(symbol, name, size, scale, unit, text) int name;
      BD_STATE_FIELDS(X)
#undef X
    };
  };
  int work;
  int modes, n_modes, n_along;  /* of a span; of all; waves along spans */
  int nm, nc;                   /* mounts, couplings, */
  const int *mounted, *coupled; /* and their pulleys */
  const int *rim;               /* by pulley the entry of the speed of what the belt runs on */
  int n_work;
  size_t size; /* of the whole vector */
} bd_layout;

static inline int bd_has_field(const bd_layout *lay, int field) {
  return field >= F_MU || (lay->fields >> field & 1u);
}

static inline void bd_place_fields(bd_layout *lay, unsigned fields) {
  int block = 0;
  lay->fields = fields;
  for (int f = 0; f <= F_MU; ++f) {
    lay->block[f] = block;
    block += bd_has_field(lay, f);
  }
}

static inline int bd_block(const bd_layout *lay, int field) {
  return field < F_MU ? lay->block[field] : lay->block[F_MU] + field - F_MU;
}

static inline double *bd_field(const bd_layout *lay, double *y, int field) {
  return y + (size_t)bd_block(lay, field) * (size_t)lay->stride + BD_HALO;
}

static inline const double *bd_cfield(const bd_layout *lay, const double *y, int field) {
  return y + (size_t)bd_block(lay, field) * (size_t)lay->stride + BD_HALO;
}

/* The same, or NULL where the belt has no such field. */
static inline const double *bd_find_field(const bd_layout *lay, const double *y, int field) {
  return bd_has_field(lay, field) ? bd_cfield(lay, y, field) : NULL;
}

/* In front of the first link stands the last one. */
static inline void bd_close_links(const bd_layout *lay, double *y) {
  for (int block = 0; block < bd_block(lay, F_MU); ++block) {
    double *v = y + (size_t)block * (size_t)lay->stride + BD_HALO;
    v[-1] = v[lay->n - 1];
  }
}

/* Blocks of a friction slot: the first of its states, and its slip. */
static inline int bd_f_state(const bd_layout *lay, int slot) {
  return F_MU + slot * lay->states;
}

static inline int bd_f_slip(const bd_layout *lay, int slot) {
  return F_MU + lay->slots * lay->states + slot;
}

/* --- base.c ---------------------------------------------------------------------------------- */

/* Objects are one block each: the same carving code runs twice, first with base NULL to add up the
 * size, then to hand out the pieces. Who carves says there what a restart record keeps of it
 * (run/record.c), and what it was given. */
typedef struct bd_carver {
  char *base;
  size_t used, n_kept;
  struct bd_kept *kept; /* NULL: counted only */
  uint64_t given;       /* check sum */
} bd_carver;

void *bd_carve(bd_carver *carver, size_t count, size_t size);
#define BD_CARVE(carver, pointer, count)                                                           \
  ((pointer) = bd_carve((carver), (size_t)(count), sizeof *(pointer)))

/* A piece of a restart record: bytes that stand in a place, or where the pointer in that place
 * leads; ints that are used as indexes or counts, from the least to the most. */
typedef struct bd_kept {
  enum { BD_KEPT_BYTES, BD_KEPT_BEHIND, BD_KEPT_INDEXES } is;
  void *place;
  size_t size;
  int least, most;
} bd_kept;

void bd_keep(bd_carver *carver, bd_kept kept);
#define BD_KEEP(carver, pointer, count)                                                            \
  (BD_CARVE(carver, pointer, count),                                                               \
   bd_keep((carver), (bd_kept){.place = (pointer), .size = (size_t)(count) * sizeof *(pointer)}))
/* Members of a struct, from one to another. */
#define BD_KEEP_SPAN(carver, of, first, last)                                                      \
  bd_keep((carver), (bd_kept){.place = &(of)->first,                                               \
                              .size = (size_t)((char *)(&(of)->last + 1) - (char *)&(of)->first)})
#define BD_KEEP_INDEXES(carver, pointer, count, lowest, highest)                                   \
  bd_keep((carver), (bd_kept){BD_KEPT_INDEXES, (pointer), (size_t)(count) * sizeof(int), (lowest), \
                              (highest)})

/* FNV-1a (Fowler, Noll, Vo), 64 bits, onto a sum that begins with BD_NOTHING. */
static const uint64_t BD_NOTHING = 0xcbf29ce484222325u;
uint64_t bd_check_sum(uint64_t sum, const void *data, size_t size);
/* Adds to the check sum of what was given. */
void bd_given(bd_carver *carver, const void *data, size_t size);
/* A copy of so many numbers that were given. */
const double *bd_carve_copy(bd_carver *carver, const double *given, size_t count);

/* A block of the links' places, the halo before its first one. */
void bd_carve_links(bd_carver *carver, const bd_layout *lay, double **block);
/* Several, one after the other at the layout's stride; of 0 NULL. */
void bd_carve_rows(bd_carver *carver, const bd_layout *lay, int count, double **rows);

void *bd_block_new(size_t size); /* zeroed, aligned to BD_ALIGN */
void bd_block_free(void *block);

#if defined(__GNUC__)
#define BD_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define BD_PRINTF(text, first)
#endif

/* Where errors are raised: fills err (may be NULL) and returns code; of a run with the time, the
 * link or the pulley (or -1) and the value. */
int bd_fail_at(bd_error *err, int code, const char *field, double t, int body, int pulley,
               double value, const char *format, ...) BD_PRINTF(8, 9);
#define bd_fail(err, code, field, ...)                                                             \
  bd_fail_at(err, code, field, (double)NAN, -1, -1, (double)NAN, __VA_ARGS__)

/* Leaves the function with the code of a call that fails. */
#define BD_TRY(call)                                                                               \
  do {                                                                                             \
    const int code_of_call = (call);                                                               \
    if (code_of_call != BD_OK) {                                                                   \
      return code_of_call;                                                                         \
    }                                                                                              \
  } while (0)

/* What a run has to say: how it failed, and what was noticed, each code once. */
typedef struct bd_report {
  bd_error failure;
  bd_warning warned[BD_N_WARNINGS]; /* message empty: not noticed */
} bd_report;

/* Keeps a warning, if it is the first of its code. */
void bd_warn(bd_report *report, int code, double t, int body, int pulley, const char *format, ...)
    BD_PRINTF(6, 7);

#endif
