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
  double wind;        /* phi of link 0 seen from link n-1: 2 pi winding */
  const double *live; /* 1 for links, 0 for the padding */
  double *cos, *sin;
  double *rx, *ry, *fx, *fy; /* scratch of linear.c */
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

enum { BD_MAX_STAGES = 7, MAX_VECTORS = 8 };

struct bd_linear_kernels;

typedef struct bd_kernels {
  const char *level;
  const struct bd_linear_kernels *linear;
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

/* --- linear algebra of the implicit methods: linear.c ----------------------------------------- */

/* One solve: g = gamma h, the mass of a link (a bath's drag included). */
typedef struct bd_stage {
  double g, mass;
} bd_stage;

/* Blocks of the ring's matrix, by link; k, bend and damping are the joints'. */
typedef struct bd_blocks {
  double k, bend, damping;
  const double *cos, *sin, *spin;
  double *xx, *xy, *yx, *yy, *pp;
} bd_blocks;

/* The joints as linearised, by link: direction, angular velocity, and the joints' pull along the
 * link over half its length; for one g, what turning it does to the forces at its ends. */
typedef struct bd_tangent {
  double *cos, *sin, *spin, *pull, *end_x, *end_y;
} bd_tangent;

/* The contact of one pulley as linearised, by link of its runs, 0 where nothing touches: normal,
 * distance from the axis, N and what it is over that, mu, dN/dp, dN/dp', and over the distance
 * dN/dp' times the speed round it and the speed away from it; d mu'/d v_T, -d mu'/d mu; what N
 * will be beyond that at the end of a step. For one g:
 * force by position and by mu, torque by position; the border's row; v_T by position; and what the
 * change of mu takes of v_T and of what is given for it. */
typedef struct bd_touch {
  double *nx, *ny, *rho, *normal, *bend, *mu, *stiff, *damp, *cross, *apart, *gain, *decay, *ahead;
  double *xx, *xy, *yx, *yy, *by_mu, *torque_x, *torque_y;
  double *row_x, *row_y, *slide_x, *slide_y, *rise, *keep;
} bd_touch;

/* The ring cut into arcs: row j of arc a is link base[a] + j. */
typedef struct bd_ring {
  int n_rows;
  int *base;
  double *shorter; /* 1: the arc's row 0 stands for no link */
  void *rows, *scratch, *ends;
} bd_ring;

/* Loops of linear.c at one instruction level. */
typedef struct bd_linear_kernels {
  int width;                  /* arcs */
  size_t ring_row, ring_ends; /* bytes: of a row of links, of the separators */
  void (*factor)(const bd_ring *ring, const bd_blocks *blocks);
  void (*solve)(const bd_ring *ring, double k, double *x, double *y, double *p);
  void (*keep_joints)(const bd_links *links, const double *y, const bd_tangent *tangent);
  void (*diagonal)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                   const bd_blocks *blocks);
  void (*joints_product)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                         const double *c, double *x, double *y, double *p);
  void (*finish_links)(const bd_links *links, const bd_stage *stage, int n_columns,
                       const double *columns, const double *factors, const double *x,
                       const double *y, const double *p, double *c);
  void (*keep_contact)(const bd_links *links, const bd_drum *drum, int n_runs, const bd_run *runs,
                       const double *y, const bd_touch *touch, int friction, double ahead);
  double (*add_ahead)(const bd_links *links, int n_runs, const bd_run *runs, const bd_touch *touch,
                      double *c);
  double (*add_contact)(const bd_drum *drum, int n_runs, const bd_run *runs, const bd_touch *touch,
                        double g, const bd_blocks *blocks, double *column_x, double *column_y);
  double (*contact_product)(const bd_layout *lay, const bd_drum *drum, int n_runs,
                            const bd_run *runs, const bd_touch *touch, int friction,
                            const double *c, double *x, double *y);
  void (*finish_contact)(const bd_layout *lay, const bd_drum *drum, int n_runs, const bd_run *runs,
                         const bd_touch *touch, double g, double spin_up, double *c);
  double (*border_row)(int n_runs, const bd_run *runs, const bd_touch *touch, const double *x,
                       const double *y);
} bd_linear_kernels;

extern const bd_linear_kernels bd_linear_baseline;

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
  int *slot; /* colour of each pulley, its friction slot: of one colour, none can share a link */
  int colours;
  bd_wrap *wraps;
  double longest_span;
  bd_error geometry; /* what bd_model_check_geometry returns */
  double far_away;   /* where the padding stands: on no pulley */
  const bd_kernels *kernels;
};

/* Time that a stretch wave takes once round the belt: the measure of what is long. */
double bd_round_time(const bd_model *model);
/* In which the lowest stretch wave round the belt decays by e: at (eta A / EA) omega^2 / 2. */
double bd_wave_life(const bd_model *model);

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
/* Unchecked, the positions shifted; the padding is left alone. */
void bd_state_put(const bd_layout *lay, const bd_state *state, double shift_x, double shift_y,
                  double *y);
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
  double *moved;        /* scratch: torques at another point */
  const volatile int *stop; /* after a function: not 0 stops the run; may be NULL */
  int watched;              /* functions: their least and largest torques are kept, by pulley */
  double *low, *high;
  int smooth; /* every term is one whose derivatives are known */
} bd_load;

void bd_load_carve(bd_carver *carver, bd_load *load, int np, const bd_torque *torque);
int bd_load_fill(bd_load *load, const bd_torque *torque, bd_error *err);
/* t_piece: a time inside the present piece, which decides the side at a jump. BD_OK,
 * BD_ERR_CALLBACK or BD_ERR_TORQUE_VALUE. */
int bd_load_eval(bd_load *load, double t, double t_piece, const double *theta, const double *omega,
                 double *torque, bd_error *err);
/* Derivatives at the same point, where the torque is `torque`: over one another, by row, (np, np)
 * to theta and omega; and to time, as the difference over dt (which stays inside the piece). */
int bd_load_derive(bd_load *load, double t, double t_piece, double *theta, double *omega,
                   const double *torque, double *by_theta, double *by_omega, bd_error *err);
int bd_load_slope(bd_load *load, double t, double dt, double t_piece, const double *theta,
                  const double *omega, const double *torque, double *slope, bd_error *err);

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
  int powerless;                 /* power is not evaluated: settling, stages that do not need it */
  int held;                      /* settling: pulleys stand still */
  double bath;                   /* settling: drag per unit mass [1/s] */
  double round_drag, round_gain; /* the same on circulation, and what divides its inertia */
  const double *offset;          /* settling: the centres' displacement at the start */
  double move_from, move_time;
  long contacts_changed; /* links that have come to a pulley or left it, with friction on */
  int n_passes;
  bd_pass passes[BD_MAX_PASSES];
  const char *names[BD_MAX_PASSES];
};

typedef struct bd_plan_options {
  int ledger, friction, hold_pulleys, powerless;
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

/* --- linear.c -------------------------------------------------------------------------------- */

typedef struct bd_linear {
  const bd_linear_kernels *ring_kernels;
  bd_ring ring;
  bd_tangent tangent;
  bd_touch *touch; /* per pulley */
  bd_blocks blocks;
  bd_stage stage;
  double *x, *y, *p; /* right-hand side and solution of the ring, with halo */
  double *border;    /* per pulley: its column, solved by the ring */
  bd_drum *drums;
  int *n_runs;
  bd_run *runs;
  double *own, *rhs, *matrix;
  int *pivots;
  double *by_theta, *by_omega, *slope, *torque; /* of the set torques */
} bd_linear;

void bd_linear_carve(bd_carver *carver, bd_linear *lin, const bd_model *model);
/* Keeps the Jacobian at a state whose rate was the last to be evaluated, but for the set torques.
 */
void bd_linearise(bd_linear *lin, const bd_plan *plan, const double *y);
void bd_linear_factor(bd_linear *lin, bd_plan *plan, double g);
/* Contact, between bd_linearise and bd_linear_factor: at the state (h = 0), or as a step of length
 * h finds it at its end. Then links that land within the step are in contact, and links on a pulley
 * go round it: by (h v_t)^2 / (2 rho) out of the tangent that the Jacobian knows, times a stiff
 * contact more than N itself. The second adds what that is worth to a rate. */
void bd_linear_look_ahead(bd_linear *lin, bd_plan *plan, const double *y, double h);
void bd_linear_add_ahead(const bd_linear *lin, const bd_plan *plan, double *c);
/* c, laid out as a state, becomes k: (1 - g J) k = g c. */
void bd_linear_solve(bd_linear *lin, bd_plan *plan, double *c);

/* --- observe.c ------------------------------------------------------------------------------- */

/* Row k of the outputs from a state (its halo is set here) and the torques at that time. */
void bd_observe(bd_plan *plan, double *y, double turns, const double *torque, double e0,
                const bd_output *out, size_t k);
/* Mean of the joint forces, tension positive. */
double bd_mean_force(const bd_plan *plan, const double *y);
double bd_energy(bd_plan *plan, double *y, double terms[BD_N_ENERGY]);

/* --- methods ------------------------------------------------------------------------------- */

enum { MAX_PAST = 2 }; /* earlier states that a multistep method may look back on */

/* A row of the table in methods.c: another method is another row, and the functions it names. */
typedef struct bd_method {
  const char *name;
  int implicit;
  int order;
  int error_order;  /* local errors go with this power of the step */
  int vectors;      /* of the size of the state, in bd_sim.stage */
  int past;         /* earlier states it looks back on */
  int adaptive;     /* its errors can set its step */
  int may_be_fixed; /* bd_options.step is the step, not the first one */
  double stability; /* limit of h |lambda|; 0: none */
  double growth;    /* of the step, at most */
  double aim[2];    /* local errors are held below aim[0] rtol^aim[1] */
  double cost[2];   /* microseconds of a step and of a link in it, measured; only ratios count */
  /* A step of length h from sim->y into sim->y_new; *error: its estimate over the weights, infinite
   * if a number is not finite. */
  int (*attempt)(bd_sim *sim, double h, double *error);
  /* What an accepted step leaves behind for the next. */
  int (*finish)(bd_sim *sim, double h, double t_new);
  /* The state at the fraction s of the step just made, into y. */
  void (*inside)(bd_sim *sim, double h, double s, double *y);
  const void *table;
} bd_method;

const bd_method *bd_method_find(const char *name); /* NULL if there is none */
/* The local error that an asked error allows, and the other way about. */
double bd_method_tolerance(const bd_method *method, double rtol);
double bd_method_error(const bd_method *method, double local);
const bd_method *bd_method_at(size_t k); /* NULL past the last */

/* Coefficients of explicit Runge-Kutta methods, erk.c. */
typedef struct bd_tableau {
  int stages; /* evaluations a step, the first taken over from the step before */
  const double *c, *a, *error;
  /* weights of the stages at fraction s of the step, for dense output */
  void (*dense)(double s, double *b);
} bd_tableau;

extern const bd_tableau bd_tsit5, bd_rk4;
int bd_erk_attempt(bd_sim *sim, double h, double *error);
int bd_erk_finish(bd_sim *sim, double h, double t_new);
void bd_erk_inside(bd_sim *sim, double h, double s, double *y);
/* Where the error of the last attempt is largest: the field's name, the link or the pulley. */
const char *bd_erk_worst(const bd_sim *sim, double h, int *body, int *pulley);

/* Coefficients of Rosenbrock methods, rosenbrock.c. */
typedef struct bd_rosenbrock {
  int stages;
  double gamma;
  const double *a, *c; /* lower triangles, by rows */
  const double *time, *slope;
  const double *dense[2]; /* of the stages, in s (1 - s) and s^2 (1 - s) */
} bd_rosenbrock;

extern const bd_rosenbrock bd_rodas4;
int bd_rosenbrock_attempt(bd_sim *sim, double h, double *error);
int bd_rosenbrock_finish(bd_sim *sim, double h, double t_new);
void bd_rosenbrock_inside(bd_sim *sim, double h, double s, double *y);

/* Linearly implicit backward differentiation, lbdf.c. */
int bd_lbdf_attempt(bd_sim *sim, double h, double *error);
int bd_lbdf_finish(bd_sim *sim, double h, double t_new);
void bd_lbdf_inside(bd_sim *sim, double h, double s, double *y);

/* --- auto.c ---------------------------------------------------------------------------------- */

enum { AUTO_EXPLICIT, AUTO_IMPLICIT, N_AUTO };

typedef struct bd_auto {
  const bd_method *method[N_AUTO];
  double per_second[N_AUTO]; /* cost of a simulated second as last seen [us]; 0: not yet */
  double time[N_AUTO];       /* simulated with each [s] */
  long steps[N_AUTO];
  int now;
  int doubtful;                     /* the implicit method may be the cheaper one */
  double h_kept, t_before, t_judge; /* step of the other method; last time; where judging began */
  long tries_begin, tries_judge;    /* steps tried when this stretch, and judging, began */
  long look_after;                  /* tries with the explicit method before the next look */
} bd_auto;

/* The two methods that "auto" goes between for this model and tolerance. */
void bd_auto_pair(const bd_model *model, double rtol, bd_auto *pair);
/* Chooses the first; afterwards, after every step, perhaps the other. */
void bd_auto_begin(bd_sim *sim);
void bd_auto_watch(bd_sim *sim);
/* What was chosen and why, in a sentence. */
void bd_auto_explain(const bd_sim *sim, char *text, size_t size);

/* --- sim.c ----------------------------------------------------------------------------------- */

/* What is known of torque functions, and scratch for asking them; arrays by pulley. */
typedef struct bd_opaque {
  double interval;              /* longest time between two calls [s] */
  int left_out, next_left_out;  /* linearisations without their derivatives: still, and next time */
  long short_tries;             /* since its last jump */
  double owed, t_owed;          /* short tries for its jumps, and when last counted */
  double jump;                  /* the largest, as local error per second */
  double rough_for;             /* how long errors of that size are let pass, */
  double rough_until;           /* and until when */
  double t_range;               /* start of the stretch whose range is being taken */
  long ranges;                  /* stretches so far */
  double *look;                 /* torques of a look */
  double *range, *least, *most; /* of the torques: over the last stretch; in this one */
  double *last, *now;           /* torques at the ends of the step just made */
  double *begin, *middle, *end, *impulse, *theta, *omega;
} bd_opaque;

/* What the guards remember. */
typedef struct bd_guard {
  double t_look, t_window; /* time of the last look; at joints and balance, at progress */
  long steps_look, tries_window;
  double fed, drive, passed; /* energy: fed in by the set torques, their work, what passed */
  double *touched;           /* per pulley: when a link was last seen on it */
} bd_guard;

/* A run beside the run, for short stretches. */
typedef struct bd_twin {
  bd_sim *sim, *still;           /* displaced; not displaced, NULL: the run itself */
  int active, grows;             /* a stretch is on; growth has been seen */
  int chatters, times_chattered; /* links do; counts in which they did */
  int stiff, light;              /* friction is; damping of the belt is */
  int suspected, last;           /* this stretch is for one of these; the last has begun */
  double next_begin;             /* of the next stretch, in rounds of a wave since the start */
  double t_begin, next_look;     /* of this one; next look */
  double apart, grown, most;     /* difference at first; growth that is one; largest seen */
  long steps, events;            /* that twins made; contacts changed at the last count */
  double t_events, t_chatter;    /* of the last count; since when links chatter */
  uint64_t random;
  double seen_t[2], *seen; /* torques of the run at a step's ends */
  double *theta;           /* pulleys' angles at the last count */
} bd_twin;

struct bd_sim {
  const bd_model *model;
  const bd_method *method, *now; /* in use; of the step just made */
  bd_auto choice;                /* of "auto"; choice.method[0] NULL: the method was named */
  bd_options options;
  bd_plan plan;
  bd_linear linear;
  bd_opaque opaque;
  bd_guard guard;
  bd_twin twin;
  double t, t0, t_end, h, turns, e0, error_before;
  double *y, *y_new, *y_mid;
  double *stage[MAX_VECTORS];               /* stage[0]: the rate at y */
  double *past[MAX_PAST], past_h[MAX_PAST]; /* states before y, and the steps that led from them */
  int n_past;
  double *weights;
  size_t next_break, next_sample, n_samples;
  double *t_sample;
  bd_output output;
  int started, rate_known, linear_known, fixed, status;
  int fallen;                 /* steps left to the first order one after the other */
  double work_middle[N_WORK]; /* power in the middle of the step just made */
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
  double settle_patience, settle_best, settle_best_time; /* least residual so far, and when */
  bd_stats stats;
  bd_error failure;
  bd_warning warned[BD_N_WARNINGS]; /* message empty: not noticed */
};

/* --- opaque.c: torque functions -------------------------------------------------------------- */

void bd_opaque_carve(bd_carver *carver, bd_opaque *opaque, int np);
/* The set torques' derivatives to angles and speeds, as far as they can be believed. */
int bd_opaque_derive(bd_sim *sim);
/* The change with time at the start of a step of length h is in linear.slope; puts that over half
 * the step in its place where the two have nothing to do with each other. */
int bd_opaque_slope(bd_sim *sim, double h);
/* Before a step of length h is accepted: *shrink < 1 if it is to be made again, so much shorter,
 * for what a torque function does within it. */
int bd_opaque_check(bd_sim *sim, double h, double t_new, double tolerance, double *shrink);
/* For a torque function that jumps all the time: the length that steps need not go below, and what
 * a step of that length may err by more; 0: it does not. */
double bd_opaque_least(const bd_sim *sim);
double bd_opaque_allowance(const bd_sim *sim, double h);
/* Before and after every try. */
void bd_opaque_try(bd_sim *sim);
void bd_opaque_tried(bd_sim *sim, double h);
/* Keeps the torque just evaluated: at the start of a step, where it was not known; at its end. */
void bd_opaque_began(bd_sim *sim);
void bd_opaque_keep(bd_sim *sim, double h);
/* Warns of a sample at t, inside the step of length h just made, whose torque no step has seen. */
void bd_opaque_sampled(bd_sim *sim, double t, double h);

/* The pulley whose torque function moves its speed by what errors may be, from one step to the
 * next; -1: none. */
int bd_opaque_jumps(const bd_sim *sim);

/* --- stiffness.c ----------------------------------------------------------------------------- */

typedef struct bd_stiffness {
  double bound;     /* of |lambda| [1/s], everything together */
  const char *what; /* has the most to do with it */
  int pulley;       /* and which pulley, -1: none in particular */
} bd_stiffness;

/* load: may be NULL. */
bd_stiffness bd_stiffness_of(const bd_model *model, const bd_load *load);

/* --- guards.c -------------------------------------------------------------------------------- */

void bd_guard_carve(bd_carver *carver, bd_guard *guard, int np);
/* Fails where the belt does not run round a pulley; where the state cannot be one of this drive. */
int bd_guard_winding(const bd_plan *plan, const double *y, bd_error *err, double t);
int bd_guard_initial(const bd_plan *plan, const double *y, bd_error *err, double t);
void bd_guard_begin(bd_sim *sim);
/* After a step; now: whether or not it is time to look. */
int bd_guard_look(bd_sim *sim, int now);
int bd_guard_progress(bd_sim *sim);

/* --- twin.c ---------------------------------------------------------------------------------- */

void bd_twin_carve(bd_carver *carver, bd_twin *twin, int np);
int bd_twin_create(bd_sim *sim, const bd_torque *torque);
/* After a step. */
void bd_twin_follow(bd_sim *sim);
/* How many times differences have grown beyond what they do in any drive. */
double bd_twin_magnifies(const bd_twin *twin);
void bd_twin_free(bd_twin *twin);

/* --- implicit.c ------------------------------------------------------------------------------ */

/* Sees that the Jacobian at y, and the rate, are there. */
int bd_sim_linearise(bd_sim *sim);
/* The set torques' change with time: over the step of length h, or at its start; and factor times
 * what it means for the pulleys, added to c. */
int bd_sim_take_slope(bd_sim *sim, double h, int at_start);
void bd_sim_add_slope(const bd_sim *sim, double *c, double factor);
/* At the end of a step: its ledger (middle: with the power in the step's middle), the next rate. */
int bd_sim_arrive(bd_sim *sim, double h, double t_new, int middle);
/* The ledger's part of a state inside the step just made. */
void bd_sim_work_inside(const bd_sim *sim, double h, double s, double *y);

/* --- failures.c ------------------------------------------------------------------------------ */

/* Numbers are no longer finite, or links were thrown about, in a trial of length h; a step that is
 * as short as steps can be does not meet the tolerance. Both return the error's code. */
int bd_sim_fail_unstable(bd_sim *sim, int code, double h);
int bd_sim_fail_floor(bd_sim *sim, double h);
/* A fixed explicit step erred by so much. */
int bd_sim_fail_fixed(bd_sim *sim, double h, double error);
/* Keeps a warning, if it is the first of its code. */
void bd_sim_warn(bd_sim *sim, int code, double t, int body, int pulley, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 6, 7)))
#endif
    ;

/* --- past.c ---------------------------------------------------------------------------------- */

/* y_new becomes y, y the first of the past. */
void bd_past_turn(bd_sim *sim, double h);
/* What happens to y after a step, whole turns taken off and friction forgotten, to the past, too.
 */
void bd_past_follow(bd_sim *sim);

/* --- sim.c, for the methods ------------------------------------------------------------------ */

/* Refuses times that rounding would blur. */
int bd_sim_check_time(const bd_model *model, const char *name, double t, bd_error *err);
/* Goes to t_new, in one step if that errs by no more than the tolerance, as another simulation has
 * done; without samples. */
int bd_sim_follow(bd_sim *sim, double t_new, double t_piece, double tolerance);
/* Longest step that the method in use is allowed to make. */
double bd_sim_longest(const bd_sim *sim, double h);
/* Rate at any time and state; counted. */
int bd_sim_rate(bd_sim *sim, double t, double *y, double *dy);
/* The rate at y, where it is not known yet, into stage[0]. */
int bd_sim_know_rate(bd_sim *sim);

/* Shared by simulating and settling: one block with everything, nothing allocated later. */
bd_sim *bd_sim_new(const bd_model *model, const bd_method *method, const bd_method *other,
                   const bd_torque *torque, int settling);
/* bd_sim_create for states that no drive can be in. */
int bd_sim_anywhere(bd_sim **out, const bd_model *model, const bd_state *initial,
                    const bd_torque *torque, double t_end, const bd_options *options,
                    bd_error *err);
void bd_sim_weights(bd_sim *sim);

#endif
