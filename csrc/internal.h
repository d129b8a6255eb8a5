/* SPDX-License-Identifier: MIT
 *
 * What the files of the core share: the layout of the state vector, the model, the kernel table,
 * the plan, the torque, the integrators and the simulation.
 *
 * Layout. One flat, 64-byte aligned vector: LINK_FIELDS blocks of `stride` doubles, then a tail
 *
 *   | x | y | phi | vx | vy | vphi | mu (slots) | slip (slots) || theta | omega | work |
 *
 * In a block link i stands at BD_HALO + i; what stands before link 0 and after link n-1 is padding,
 * kept at rest.
 * Positions are relative to the model's origin and phi to `turns` whole turns, so neither a far
 * scene nor a belt that has circulated for long costs digits of stretch.
 */
#ifndef BELTDYN_INTERNAL_H
#define BELTDYN_INTERNAL_H

#include <stdatomic.h>

#include "beltdyn.h"

#define BD_PI 3.14159265358979323846
#define BD_HALO 8
#define BD_LANES 8 /* blocks are padded to the widest vector */
#define BD_ALIGN 64

enum { F_X, F_Y, F_PHI, F_VX, F_VY, F_VPHI, F_MU };

/* Work integrals carried in the tail, in the order of the ledger's terms. */
enum { W_DRIVE, W_JOINT, W_CONTACT, W_FRICTION, N_WORK };

typedef struct bd_layout {
  int n, n8, np, slots;
  int stride;             /* doubles per block */
  int theta, omega, work; /* offsets of the tail */
  size_t size;            /* of the whole vector */
} bd_layout;

static inline double *bd_field(const bd_layout *lay, double *y, int field) {
  return y + (size_t)field * (size_t)lay->stride + BD_HALO;
}

static inline const double *bd_cfield(const bd_layout *lay, const double *y, int field) {
  return y + (size_t)field * (size_t)lay->stride + BD_HALO;
}

static inline int bd_f_slip(const bd_layout *lay) {
  return F_MU + lay->slots;
}

/* --- base.c ---------------------------------------------------------------------------------- */

/* Objects are one block each: the same carving code runs twice, first with base NULL to add up the
 * size, then to hand out the pieces. */
typedef struct bd_carver {
  char *base;
  size_t used;
} bd_carver;

void *bd_carve(bd_carver *carver, size_t count, size_t size);
#define BD_CARVE(carver, pointer, count)                                                           \
  ((pointer) = bd_carve((carver), (size_t)(count), sizeof *(pointer)))

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

/* --- kernels --------------------------------------------------------------------------------- */

/* Per-link constants, and the links' directions at the last evaluation. */
typedef struct bd_links {
  bd_layout lay;
  double half; /* l0 / 2 */
  double stiffness, damping, bending, bending_damping;
  double inv_mass, inv_inertia;
  double wind; /* phi of link 0 seen from link n-1: 2 pi winding */
  double *cos, *sin;
} bd_links;

/* One pulley as the contact pass sees it. */
typedef struct bd_drum {
  double x, y, vx, vy; /* centre, relative to the origin, and its velocity */
  double radius, omega;
  double quadratic, linear, damping;
  double mu_k, sigma;
  int slot;
} bd_drum;

typedef struct bd_run {
  int begin, end; /* links, multiples of BD_LANES */
} bd_run;

typedef struct bd_sums {
  double torque, contact_loss, friction_loss;
} bd_sums;

enum { BD_MAX_STAGES = 7 };

typedef struct bd_kernels {
  const char *level;
  /* Sets the link blocks of dy: velocities, joint accelerations, zero friction rates; returns the
   * power lost in the joints' dampers. Variants [bending][ledger]. */
  double (*joints[2][2])(const bd_links *links, const double *y, double *dy);
  /* Adds the contact of one pulley with the links of the runs. Variants [friction][ledger]. */
  void (*contact[2][2])(const bd_links *links, const bd_drum *drum, int n_runs, const bd_run *runs,
                        const double *y, double *dy, bd_sums *sums);
  /* After a step, the first block of BD_LANES links in [begin, end) with a link that has come to
   * this pulley or left it, remembers friction that it must forget or more than mu_k, or is half a
   * radius deep; `end` if none. owner: of the pulley's slot. Variants [friction]. */
  int (*upset[2])(const bd_layout *lay, const bd_drum *drum, int pulley, const double *owner,
                  const double *y, int begin, int end);
  /* Largest squared speed of a link. */
  double (*fastest)(const bd_layout *lay, const double *y);
  /* out = y + h sum a[j] k[j] */
  void (*combine)(size_t n, double *out, const double *y, double h, int m, const double *a,
                  double *const *k);
  /* Largest w |h sum e[j] k[j]| over links and pulleys, positions and velocities as vectors, so
   * that it does not depend on the axes; NaN becomes infinity. */
  double (*error_norm)(const bd_layout *lay, double h, int m, const double *e, double *const *k,
                       const double *w);
} bd_kernels;

const bd_kernels *bd_kernels_choose(void);

/* --- model ----------------------------------------------------------------------------------- */

/* The tight belt line at one pulley: where the belt arrives and leaves (angles seen from the
 * centre, in running order), and the straight span that follows. */
typedef struct bd_wrap {
  double arrive, wrap; /* wrap > 0; the belt leaves at arrive + direction * wrap */
  double span;         /* length of the span to the next pulley */
} bd_wrap;

struct bd_model {
  bd_info info;
  bd_belt belt;
  bd_contact contact;
  bd_dahl dahl;
  int has_friction, bends, heavy;
  double gravity[2], origin[2];
  bd_layout lay;
  double *cx, *cy, *radius, *inertia; /* centres relative to the origin */
  int *slot; /* friction slot of each pulley: pulleys that share one cannot share a link */
  bd_wrap *wraps;
  double longest_span;
  bd_error geometry; /* what bd_model_check_geometry returns */
  const bd_kernels *kernels;
};

/* Lays the belt line round pulleys at (cx, cy); returns BD_ERR_GEOMETRY with the reason if there is
 * none. direction: +1 counter-clockwise, -1 clockwise. */
int bd_path_lay(int np, const double *cx, const double *cy, const double *radius, bd_wrap *wraps,
                int *direction, double *length, bd_error *err);
/* Point and tangent angle at distance s along the line from where the belt leaves pulley 0; the
 * angle runs on continuously. */
void bd_path_point(int np, const double *cx, const double *cy, const double *radius,
                   const bd_wrap *wraps, int direction, double s, double *x, double *y,
                   double *phi);
int bd_path_overlap(int np, const double *cx, const double *cy, const double *radius, int *i,
                    int *j);

/* --- state.c --------------------------------------------------------------------------------- */

/* Between the caller's arrays and the flat vector; import checks that all is finite and takes whole
 * turns off phi, `turns` of them. */
int bd_state_import(const bd_model *model, const bd_state *state, double *y, double *turns,
                    bd_error *err);
void bd_state_export(const bd_model *model, const double *y, double turns, bd_state *state);
/* Moves whole turns from phi to *turns once they would cost digits. */
void bd_state_wind(const bd_layout *lay, double *y, double *turns);
/* First non-finite entry by name and index; NULL if none. */
const char *bd_state_bad(const bd_layout *lay, const double *y, int *body, int *pulley);

/* --- torque.c -------------------------------------------------------------------------------- */

typedef struct bd_load {
  int np;
  size_t n_terms, n_breaks;
  bd_torque_term *terms;
  double *breaks;       /* sorted, distinct */
  double after, before; /* the breaks round the present piece; functions never see them exactly */
  double *part;         /* scratch: one term's torques */
} bd_load;

void bd_load_carve(bd_carver *carver, bd_load *load, int np, const bd_torque *torque);
int bd_load_fill(bd_load *load, const bd_torque *torque, bd_error *err);
/* t_piece: a time inside the present piece, which decides the side at a jump. BD_OK,
 * BD_ERR_CALLBACK or BD_ERR_TORQUE_VALUE. */
int bd_load_eval(bd_load *load, double t, double t_piece, const double *theta, const double *omega,
                 double *torque, bd_error *err);

/* --- search.c: links that can touch ---------------------------------------------------------- */

typedef struct bd_search {
  double margin;    /* how far outside a pulley links are still listed [m] */
  double travelled; /* how far a link can have gone since the list was made */
  int *n_runs;      /* per pulley */
  bd_run *runs;     /* per pulley, max_runs apart */
  int max_runs;
  long rebuilds;
} bd_search;

void bd_search_carve(bd_carver *carver, bd_search *search, const bd_layout *lay);

/* --- plan.c ---------------------------------------------------------------------------------- */

typedef struct bd_plan bd_plan;
typedef int (*bd_pass)(bd_plan *plan, double t, double *y, double *dy, bd_error *err);

enum { BD_MAX_PASSES = 8 };

/* What one evaluation of the right-hand side needs: the passes in order, and their scratch. An
 * effect that is off has no pass. */
struct bd_plan {
  const bd_model *model;
  const bd_kernels *kernels;
  bd_links links;
  bd_drum *drums;
  double *owner; /* pulley that holds a friction slot, -1: none; (slots, n8) */
  bd_search search;
  bd_load load;
  double *torque;   /* M_d of the last evaluation */
  double *friction; /* friction torque on each pulley */
  double *best;     /* scratch of the output, per link */
  double t_piece;
  int ledger, friction_on, bending_on;
  int held;                      /* settling: pulleys stand still */
  double bath;                   /* settling: drag per unit mass [1/s] */
  double round_drag, round_gain; /* the same on circulation, and what divides its inertia */
  const double *offset;          /* settling: the centres' displacement at the start */
  double move_from, move_time;
  int n_passes;
  bd_pass passes[BD_MAX_PASSES];
  const char *names[BD_MAX_PASSES];
};

typedef struct bd_plan_options {
  int ledger, friction, hold_pulleys, loaded;
  double bath;
  const double *offset;
  double move_from, move_time;
} bd_plan_options;

void bd_plan_carve(bd_carver *carver, bd_plan *plan, const bd_layout *lay);
void bd_plan_make(bd_plan *plan, const bd_model *model, const bd_plan_options *options);
int bd_plan_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err);
double bd_plan_circulation(const bd_plan *plan, const double *y);
/* Centres at time t into the drums (they stand still unless settling moves them). */
void bd_plan_place(bd_plan *plan, double t);
/* Which pulley holds each friction slot, from positions alone, at the start of a run; memory that
 * no pulley holds is cleared. */
void bd_plan_own(bd_plan *plan, double *y);
/* MODEL section 4 after a step: friction memory of a link off its pulley goes to 0, |mu| <= mu_k.
 * *changed: by more than `tolerance`, so that the rates must be taken anew. Fails when a link has
 * sunk past half a pulley's radius. */
int bd_plan_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                       bd_error *err);

/* --- search.c, on a plan -------------------------------------------------------------------- */

/* Keeps the search list right for a step of length h from y: every link that can touch a pulley
 * within the step is listed. */
void bd_search_ready(bd_plan *plan, const double *y, double h);

/* --- observe.c ------------------------------------------------------------------------------- */

/* Row k of the outputs from a state (its halo is set here) and the torques at that time. */
void bd_observe(bd_plan *plan, double *y, double turns, const double *torque, double e0,
                const bd_output *out, size_t k);
/* Mean of the joint forces, tension positive. */
double bd_mean_force(const bd_plan *plan, const double *y);
double bd_energy(bd_plan *plan, double *y, double terms[BD_N_ENERGY]);

/* --- integrators ----------------------------------------------------------------------------- */

typedef struct bd_tableau {
  const char *name;
  int stages; /* evaluations a step, the first taken over from the step before */
  int order;
  const double *c, *a, *error; /* error NULL: fixed step */
  /* weights of the stages at fraction s of the step, for dense output */
  void (*dense)(double s, double *b);
  double stability; /* real stability limit h |lambda| */
} bd_tableau;

const bd_tableau *bd_tableau_find(const char *name);

/* --- sim.c ----------------------------------------------------------------------------------- */

struct bd_sim {
  const bd_model *model;
  const bd_tableau *method;
  bd_options options;
  bd_plan plan;
  double t, t0, t_end, h, turns, e0, error_before;
  double *y, *y_new, *y_mid;
  double *stage[BD_MAX_STAGES];
  double *weights;
  size_t next_break, next_sample, n_samples;
  double *t_sample;
  bd_output output;
  int started, rate_known, status;
  atomic_flag running;
  /* Settling only (settle.c): looks at every step, or its failure; may end the run or restart it.
   */
  int (*watch)(bd_sim *sim, int code, int *finished);
  bd_settle_options settle;
  double *settle_start, *settle_offset, *settle_centers, settle_turns;
  bd_wrap *settle_wraps;
  int settle_tries;
  double settle_push, settle_speed, settle_time; /* circulation at the last check */
  double settle_stiffness;
  bd_stats stats;
  bd_error failure;
};

/* Shared by simulating and settling: one block with everything, nothing allocated later. */
bd_sim *bd_sim_new(const bd_model *model, const bd_torque *torque, int settling);
void bd_sim_weights(bd_sim *sim);

#endif
