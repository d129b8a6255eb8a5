/* SPDX-License-Identifier: MIT
 *
 * What everything stands on: memory in blocks, errors, the layout of the state vector.
 *
 * Layout. One flat, 64-byte aligned vector: LINK_FIELDS blocks of `stride` doubles, then a tail
 *
 *   | x | y | phi | vx | vy | vphi | mu (slots, states) | slip (slots) || theta | omega | parts
 *   | work |
 *
 * Of the first six a belt has those of its model, one after the other.
 * In a block link i stands at BD_HALO + i; what stands before link 0 and after link n-1 is padding,
 * kept at rest.
 * Positions are relative to the model's origin and phi to `turns` whole turns, so neither a far
 * scene nor a belt that has circulated for long costs digits of stretch.
 */
#ifndef BELTDYN_BASE_H
#define BELTDYN_BASE_H

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
  unsigned fields;     /* of nodes that it has: a bit each, */
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
 * size, then to hand out the pieces. What a restart record keeps (run/record.c) is carved with
 * BD_KEEP, in any order: it lies together behind all else, and its pointers stay. */
typedef struct bd_carver {
  char *base, *kept;
  size_t used, n_kept;
} bd_carver;

void *bd_carve(bd_carver *carver, size_t count, size_t size);
void *bd_carve_kept(bd_carver *carver, size_t count, size_t size);
#define BD_CARVE(carver, pointer, count)                                                           \
  ((pointer) = bd_carve((carver), (size_t)(count), sizeof *(pointer)))
#define BD_KEEP(carver, pointer, count)                                                            \
  ((pointer) = bd_carve_kept((carver), (size_t)(count), sizeof *(pointer)))

/* A copy of so many numbers. */
const double *bd_carve_copy(bd_carver *carver, const double *given, size_t count);

/* A block of the links' places, the halo before its first one. */
void bd_carve_links(bd_carver *carver, const bd_layout *lay, double **block);
/* Several, one after the other at the layout's stride; of 0 NULL. */
void bd_carve_rows(bd_carver *carver, const bd_layout *lay, int count, double **rows);

void *bd_block_new(size_t size); /* zeroed, aligned to BD_ALIGN */
void bd_block_free(void *block);

/* Where errors are raised: fills err (may be NULL) and returns code. */
int bd_fail(bd_error *err, int code, const char *field, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 4, 5)))
#endif
    ;
/* The same for a failure of a run: with the time, the link or the pulley (or -1) and the value. */
int bd_fail_at(bd_error *err, int code, const char *field, double t, int body, int pulley,
               double value, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 8, 9)))
#endif
    ;

/* What a run has to say: how it failed, and what was noticed, each code once. */
typedef struct bd_report {
  bd_error failure;
  bd_warning warned[BD_N_WARNINGS]; /* message empty: not noticed */
} bd_report;

/* Keeps a warning, if it is the first of its code. */
void bd_warn(bd_report *report, int code, double t, int body, int pulley, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 6, 7)))
#endif
    ;

#endif
