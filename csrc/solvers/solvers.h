/* SPDX-License-Identifier: MIT
 *
 * Integration methods, the linear systems of the implicit ones, and torque functions between steps.
 */
#ifndef BELTDYN_SOLVERS_H
#define BELTDYN_SOLVERS_H

#include "belts/belts.h"

/* --- newton_system.c ------------------------------------------------------------------------- */

/* What contact adds to the small matrix for one g where an axis moves with a body: the torque on
 * the pulley by the body's speed, the force along its way by the pulley's and by its own; and what
 * the given place of the body is worth as torque, and as force. */
typedef struct bd_axis_border {
  double torque, by_spin, own, given_torque, given;
} bd_axis_border;

typedef struct bd_newton_system {
  const bd_newton_kernels *kernels, *ring_kernels;
  bd_ring ring;
  bd_derivatives at; /* the effects', at the state */
  double g;          /* gamma h */
  double *x, *y, *p; /* right-hand side and solution of the ring, with halo, at the stride */
  double *border;    /* per body: its column, solved by the ring, */
  int width;         /* so many numbers apart */
  bd_assembled blocks;
  bd_contact_scratch scratch; /* of contact along the links */
  bd_slot *slots;             /* per pulley */
  struct bd_ale_system *ale;  /* of an ALE belt, newton_ale.c */
  bd_body *bodies;            /* per shaft, mount, rim */
  bd_axis_border *axes;       /* per pulley */
  double *own, *rhs, *off, *of_bodies,
      *matrix; /* off: what is to be taken off the right-hand side */
  int *pivots;
  double *by_theta, *by_omega, *by_time; /* of the set torques */
} bd_newton_system;

/* Cuts a ring of n links, at least as many as there are arcs, into arcs. */
void bd_ring_carve(bd_carver *carver, bd_ring *ring, const bd_newton_kernels *kernels, int n);
void bd_newton_carve(bd_carver *carver, bd_newton_system *system, const bd_model *model);
void bd_nodes_newton_carve(bd_carver *carver, bd_newton_system *system, const bd_model *model);
/* Refuses a plan with an effect whose derivatives are not known. */
int bd_newton_check(const bd_plan *plan, const char *method, bd_error *err);
/* Keeps the Jacobian at a state whose rate was the last to be evaluated, but for the set torques.
 */
void bd_newton_linearise(bd_newton_system *system, const bd_plan *plan, const double *y);
/* Contact is derived at y as it stands there (c NULL), or as a step of length h finds it at its
 * end. Then links that land within the step are in contact, and links on a pulley go round it: by
 * (h v_t)^2 / (2 rho) out of the tangent that the Jacobian knows, times a stiff contact more than N
 * itself. What that is worth is added to the rate c. */
void bd_newton_factor(bd_newton_system *system, bd_plan *plan, double *y, double g, double h,
                      double *c);
/* c, laid out as a state, becomes k: (1 - g J) k = g c. */
void bd_newton_solve(bd_newton_system *system, bd_plan *plan, double *c);

/* What a belt has in these systems, named by its row; vectors are of all its unknowns, as it lays
 * them, halo in front. Carves x, border and width; keeps its derivatives (bd_newton_linearise).
 * Fills matrices, rows and columns of bodies, and their own entries (bd_newton_fill), and factors
 * its own; solves with it, in place; a body's row times a solution; the right-hand sides from c, of
 * itself (system->x) and of bodies (rhs); its unknowns into c, from the solution less columns times
 * factors; those that follow from all others; entries of J, as bd_newton_entries. */
struct bd_entries;
struct bd_newton_belt {
  void (*carve)(bd_carver *carver, bd_newton_system *system, const bd_model *model);
  void (*linearise)(bd_newton_system *system, const bd_plan *plan, const double *y);
  void (*fill)(bd_newton_system *system, const bd_plan *plan, double *y, double g, double h,
               double *c, double mass);
  void (*factor)(bd_newton_system *system);
  /* Of the ring alone, n right-hand sides `width` after one another. */
  void (*solve)(const bd_newton_system *system, const bd_layout *lay, int n, double *v);
  double (*row)(const bd_newton_system *system, const bd_plan *plan, int body, const double *v);
  /* Adds its part between bodies to the small matrix (n, n), inertias times `damped`. */
  void (*bodies)(const bd_newton_system *system, const bd_layout *lay, double damped, int n,
                 double *w);
  void (*product)(bd_newton_system *system, const bd_plan *plan, double *c);
  void (*finish)(const bd_newton_system *system, const bd_plan *plan, int n, const double *columns,
                 const double *factors, double *c);
  void (*restore)(const bd_newton_system *system, const bd_plan *plan, double *c);
  void (*entries)(bd_newton_system *system, bd_plan *plan, double *y, double *c,
                  struct bd_entries *to);
};

/* The parts of which these are made, for jacobian.c. Blocks and border for links of this mass; the
 * right-hand side of ring and bodies, g M c_v + Q c_q and what given states are worth; states of
 * friction and slip where all else is solved, of bodies the speeds in rhs; entries of W between
 * bodies, inertias times `damped`, into of_bodies. */
void bd_newton_fill(bd_newton_system *system, const bd_plan *plan, double *y, double g, double h,
                    double *c, double mass);
void bd_newton_product(bd_newton_system *system, const bd_plan *plan, double *c);
void bd_newton_restore(const bd_newton_system *system, const bd_plan *plan, double *c);
void bd_newton_bodies(bd_newton_system *system, const bd_plan *plan, double g, double damped);
/* Factors of a small full matrix by rows, in place; solutions, in place of the right-hand side. */
void bd_dense_factor(int n, double *a, int *pivots);
void bd_dense_solve(int n, const double *a, const int *pivots, double *x);
/* Behind the last node comes the first, before the first the last. */
void bd_newton_close(const bd_layout *lay, double *c);

/* The part of a body's column that the ring takes: T^-1 B, three blocks. */
static inline double *bd_newton_border(const bd_newton_system *system, int body) {
  return system->border + (size_t)body * (size_t)system->width + BD_HALO;
}

/* A row of a body times vectors by node, where pulley j is near. */
double bd_newton_row(const bd_newton_system *system, const bd_plan *plan, int j, const double *row,
                     const double *const *v);

/* --- jacobian.c ------------------------------------------------------------------------------ */

/* Entries of J that are not 0, each once, counted in n; values NULL: only counted. place: of an
 * entry of the state vector, its number among the unknowns. */
typedef struct bd_entries {
  const int *place;
  size_t n;
  int64_t *rows, *columns;
  double *values;
} bd_entries;

/* Where entries are read, from units put into c, laid out as a state. */
typedef struct bd_reading {
  bd_newton_system *system;
  bd_plan *plan;
  bd_entries *to;
  double *c;
} bd_reading;

/* Of the effects' own states; `column`: reads the column of a state by which forces go. */
void bd_newton_put_states(const bd_reading *r, void (*column)(const void *reading, int state));
/* An entry, if it is not 0; row -1: there is none. */
void bd_newton_put(bd_entries *to, int row, int column, double value);
/* At a state that has been linearised, which sets the system up for another g; torques constant,
 * pulleys not locked. c: scratch, laid out as a state. */
void bd_newton_entries(bd_newton_system *system, bd_plan *plan, double *y, double *c,
                       bd_entries *to);

/* --- axis_border.c --------------------------------------------------------------------------- */

/* The axis of pulley j; 0: it stands. */
int bd_axis_at(const bd_newton_system *system, int j, double g, bd_axis *out);
/* After the fill of pulley j: its axis in the small matrix. */
void bd_axis_fill(bd_newton_system *system, const bd_layout *lay, int j, const bd_axis *at);
/* Adds what contact has to do with axes that move to the small matrix (n, n). */
void bd_axis_entries(const bd_newton_system *system, const bd_layout *lay, double damped, int n,
                     double *w);
/* What c says of the body with which the axis of pulley j moves, into right-hand sides; states: the
 * force on the belt of the given states of friction. */
void bd_axis_product(bd_newton_system *system, const bd_plan *plan, int j, const double *c,
                     const double states[2]);
/* The move of all links against an axis. */
double *bd_axis_move(const bd_plan *plan, const bd_moving_axis *axis, const double *c,
                     double move[4]);

typedef struct bd_stepper bd_stepper;

/* --- methods.c ------------------------------------------------------------------------------- */

enum { MAX_HISTORY = 2 }; /* earlier states that a multistep method may look back on */

/* An integration method, a row of the table in methods.c.
 *
 * error_target: what it must hold its local errors below for joint forces to come out about as
 * near, over the mean tension, as rtol asks, measured with benchmarks/calibration.py: damping out
 * the belt's vibration, as methods of low order do, is an error that adds up over time, so they
 * need local errors that go with the square. Contact along the links has no jumps, and there errors
 * of calm drives come out smaller: error_target_smooth. cost: measured with benchmarks/kernels.py.
 */
typedef struct bd_method {
  const char *name;
  int implicit;
  int order;
  int error_order;        /* local errors go with this power of the step */
  int vectors;            /* of the size of the state, in bd_stepper.stage */
  int history;            /* earlier states it looks back on */
  int adaptive;           /* its errors can set its step */
  int middle;             /* works are summed by the power in the middle of a step as well */
  int may_be_fixed;       /* bd_options.step is the step, not the first one */
  double stability;       /* limit of h |lambda|; 0: none */
  double growth;          /* of the step, at most */
  double error_target[2]; /* local errors are held below error_target[0] rtol^error_target[1] */
  double error_target_smooth[2]; /* the same where contact is along the links; 0: as error_target */
  double cost[2]; /* microseconds of a step and of a link in it, measured; only ratios count */
  /* A step of length h from stepper->y into stepper->y_new; *error: its estimate over the weights,
   * infinite if a number is not finite. */
  int (*attempt)(bd_stepper *stepper, double h, double *error);
  /* What an accepted step leaves behind for the next. */
  int (*finish)(bd_stepper *stepper, double h, double t_new);
  /* The state at the fraction s of the step just made, into y. */
  void (*inside)(bd_stepper *stepper, double h, double s, double *y);
  const void *table;
} bd_method;

const bd_method *bd_method_find(const char *name); /* NULL if there is none */
/* The local error that an asked error allows, and the other way about. */
double bd_method_tolerance(const bd_method *method, const bd_model *model, double rtol);
double bd_method_error(const bd_method *method, const bd_model *model, double local);
const bd_method *bd_method_at(size_t k); /* NULL past the last */
/* The longest step of an adaptive explicit method. */
double bd_method_longest(const bd_method *method, const bd_model *model);

/* An explicit Runge-Kutta method, erk.c. */
typedef struct bd_tableau {
  int stages; /* evaluations a step, the first taken over from the step before */
  const double *c, *a, *error;
  /* weights of the stages at fraction s of the step, for dense output */
  void (*dense)(double s, double *b);
} bd_tableau;

#define BD_EXPLICIT(tableau)                                                                       \
  .attempt = bd_erk_attempt, .finish = bd_erk_finish, .inside = bd_erk_inside, .table = (tableau)

int bd_erk_attempt(bd_stepper *stepper, double h, double *error);
int bd_erk_finish(bd_stepper *stepper, double h, double t_new);
void bd_erk_inside(bd_stepper *stepper, double h, double s, double *y);
/* Where the error of the last attempt is largest: the field's name, the link or the pulley. */
const char *bd_erk_worst(const bd_stepper *stepper, double h, int *body, int *pulley);

/* A Rosenbrock method, rosenbrock.c. */
typedef struct bd_rosenbrock {
  int stages;
  double gamma;
  const double *a, *c; /* lower triangles, by rows */
  const double *time, *slope;
  const double *dense[2]; /* of the stages, in s (1 - s) and s^2 (1 - s) */
} bd_rosenbrock;

#define BD_ROSENBROCK(coefficients)                                                                \
  .attempt = bd_rosenbrock_attempt, .finish = bd_implicit_finish, .inside = bd_rosenbrock_inside,  \
  .middle = 1, .table = (coefficients)

int bd_rosenbrock_attempt(bd_stepper *stepper, double h, double *error);
void bd_rosenbrock_inside(bd_stepper *stepper, double h, double s, double *y);

/* --- stepper.c ------------------------------------------------------------------------------- */

/* What steps know of torque functions (torque_functions.c); arrays by pulley. */
typedef struct bd_torque_functions {
  double interval;             /* longest time between two calls [s] */
  int left_out, next_left_out; /* linearisations without derivatives: still to come, next time */
  long short_tries;            /* tries shorter than the shortest step since the last jump */
  double owed, t_owed;         /* short tries spent on jumps, less what time has paid; as of when */
  double jump;                 /* the largest jump, as local error per second */
  double rough_for;            /* how long errors of that size are accepted, */
  double rough_until;          /* and until when */
  double t_range;              /* start of the interval whose range of torques is being taken */
  long ranges;                 /* such intervals so far */
  double *look;                /* torques of one call along a step */
  double *range, *least, *most; /* of the torques: over the last interval; in this one */
  double *last, *now;           /* torques at the ends of the step just made; now: at y */
  double *begin, *middle, *end; /* scratch: torques along a step */
  double *impulse, *theta, *omega;
} bd_torque_functions;

/* What an integration method sees: the state, its stages, the states before it, the linear system,
 * the torques. Nothing of the run: stops, samples, guards. */
struct bd_stepper {
  const bd_model *model;
  const bd_method *method, *now; /* in use; of the step being made or just made */
  double rtol, max_step;         /* asked for; max_step 0: none */
  bd_plan plan;
  bd_newton_system newton;
  bd_torque_functions functions;
  double *y, *y_new, *y_mid;     /* at t; after the attempt; scratch */
  double *weights;               /* of errors, by unknown */
  double *stage[MAX_VECTORS];    /* stage[0]: the rate at y, if it is known; the last one of the
                                  * method: that at y_new, once the step is finished */
  double *history[MAX_HISTORY];  /* states before y */
  double history_h[MAX_HISTORY]; /* and the lengths of the steps that led from them */
  double t, h, turns;            /* h: length of the next step */
  int fixed;                     /* the step is given, errors do not set it */
  int rate_known;
  long nfev, njev, nlu;
  bd_report report;
  int n_history, jacobian_known;
  double *work_middle; /* power in the middle of the step just made */
};

/* Room for a method, and for another one that may take over (or NULL). */
void bd_stepper_carve(bd_carver *carver, bd_stepper *stepper, const bd_model *model,
                      const bd_method *method, const bd_method *other, const bd_torque *torque);
void bd_stepper_weigh(bd_stepper *stepper);
/* The weights of friction again, after links have come to a pulley or left one. */
void bd_stepper_weigh_friction(bd_stepper *stepper);
/* Set torques at any time, in the present piece, and state. */
int bd_stepper_torque(bd_stepper *stepper, double t, const double *y, double *torque);
/* Rate at any time and state; counted. */
int bd_stepper_rate(bd_stepper *stepper, double t, double *y, double *dy);
/* The rate at y, where it is not known yet, into stage[0]. */
int bd_stepper_ensure_rate(bd_stepper *stepper);
/* Longest step that the method in use is allowed to make, h at most. */
double bd_stepper_longest(const bd_stepper *stepper, double h);
/* Goes on from the finished step of length h: y_new becomes y, y the first state of the history,
 * and the last stage, the rate at y_new, becomes stage[0]. rate_holds: y_new has not been changed
 * since that rate was taken. */
void bd_stepper_advance(bd_stepper *stepper, double h, double t_new, int rate_holds);
/* Goes back to y as another state altogether: no rate, no Jacobian, no list of links is right. */
void bd_stepper_reset(bd_stepper *stepper);
/* Makes one stepper stand where another stands. */
void bd_stepper_copy(bd_stepper *to, const bd_stepper *from);

/* --- implicit.c ------------------------------------------------------------------------------ */

/* Evaluates the Jacobian at y, and the rate, unless they are known; of contact that comes about
 * while links go as far as `ahead`, too. */
int bd_implicit_linearise(bd_stepper *stepper, double ahead);
/* The set torques' change with time: over the step of length h, or at its start; and factor times
 * what it means for the pulleys, added to c. */
int bd_implicit_torque_by_time(bd_stepper *stepper, double h, int at_start);
void bd_implicit_add_torque_by_time(const bd_stepper *stepper, double *c, double factor);
/* What prescribed motions change over the step of length h, into c, so that a solve with g gives it
 * back. */
int bd_implicit_prescribe(bd_stepper *stepper, double h, double g, double *c);
/* What a linear system with g hides from the error estimate of a step of length h: y_new, at its
 * end or of its last stage, is off the line along which effects were linearised. */
double bd_implicit_hidden_error(const bd_stepper *stepper, double h, double g, const double *y_new);
/* Before anything happens to y_new: power in the middle of the step, for methods that have it in
 * their ledger. At the end of a step: its ledger, the next rate. */
int bd_implicit_middle(bd_stepper *stepper, double h);
int bd_implicit_finish(bd_stepper *stepper, double h, double t_new);
/* The ledger's part of a state inside the step just made. */
void bd_implicit_work_inside(const bd_stepper *stepper, double h, double s, double *y);

/* --- history.c ------------------------------------------------------------------------------- */

/* y_new becomes y, y the first state of the history. */
void bd_history_push(bd_stepper *stepper, double h);
/* Applies to the history what happened to y after a step: whole turns taken off, friction states
 * reset. */
void bd_history_rebase(bd_stepper *stepper);

/* --- torque_functions.c
 * -------------------------------------------------------------------------------- */

void bd_torque_functions_carve(bd_carver *carver, bd_torque_functions *functions, int np);
/* The set torques' derivatives to angles and speeds, as far as a second look confirms them. */
int bd_torque_functions_derive(bd_stepper *stepper);
/* The change with time at the start of a step of length h is in newton.by_time; replaces it by that
 * over half the step where the two differ by more than half. */
int bd_torque_functions_by_time(bd_stepper *stepper, double h);
/* Before a step of length h is accepted: *shrink < 1 if it is to be made again, shorter by that
 * factor, for what a torque function does within it. */
int bd_torque_functions_check_step(bd_stepper *stepper, double h, double t_new, double tolerance,
                                   double *shrink);
/* For a torque function that jumps all the time: the shortest step made for its sake, and the error
 * accepted of a step of that length beyond the tolerance; 0: it does not jump. */
double bd_torque_functions_shortest_step(const bd_stepper *stepper);
double bd_torque_functions_extra_error(const bd_stepper *stepper, double h);
/* Before and after every try. */
void bd_torque_functions_before_try(bd_stepper *stepper);
int bd_torque_functions_after_try(bd_stepper *stepper, double h, double error);
/* Keeps the torque just evaluated: at the start of a step, where it was not known; at its end. */
void bd_torque_functions_set_torque(bd_stepper *stepper);
int bd_torque_functions_push_torque(bd_stepper *stepper, double h);
/* Warns of a sample at t, inside the step of length h just made, whose torque no step has seen. */
void bd_torque_functions_check_sample(bd_stepper *stepper, double t, double h);

/* The pulley whose torque function moves its speed by what errors may be, from one step to the
 * next; -1: none. */
int bd_torque_functions_jumping(const bd_stepper *stepper);

#endif
