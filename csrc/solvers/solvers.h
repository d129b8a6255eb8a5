/* SPDX-License-Identifier: MIT
 *
 * Integration methods, the linear systems of the implicit ones, and torque functions between steps.
 */
#ifndef BELTDYN_SOLVERS_H
#define BELTDYN_SOLVERS_H

#include "physics/physics.h"

/* --- newton_system.c ---------------------------------------------------------------------------
 */

typedef struct bd_newton_system {
  const bd_newton_kernels *ring_kernels;
  bd_ring ring;
  bd_tangent tangent;
  bd_contact_tangent *contact; /* per pulley */
  bd_blocks blocks;
  bd_stage stage;
  double *x, *y, *p; /* right-hand side and solution of the ring, with halo */
  double *border;    /* per pulley: its column, solved by the ring */
  bd_contact_pulley *contact_pulleys;
  int *n_runs;
  bd_run *runs;
  double *own, *rhs, *matrix;
  int *pivots;
  double *by_theta, *by_omega, *by_time, *torque; /* of the set torques */
} bd_newton_system;

void bd_newton_carve(bd_carver *carver, bd_newton_system *system, const bd_model *model);
/* Keeps the Jacobian at a state whose rate was the last to be evaluated, but for the set torques.
 */
void bd_newton_linearise(bd_newton_system *system, const bd_plan *plan, const double *y);
void bd_newton_factor(bd_newton_system *system, bd_plan *plan, double g);
/* Contact, between bd_newton_linearise and bd_newton_factor: at the state (h = 0), or as a step of
 * length h finds it at its end. Then links that land within the step are in contact, and links on a
 * pulley go round it: by (h v_t)^2 / (2 rho) out of the tangent that the Jacobian knows, times a
 * stiff contact more than N itself. The second adds what that is worth to a rate. */
void bd_newton_linearise_contact(bd_newton_system *system, bd_plan *plan, const double *y,
                                 double h);
void bd_newton_add_normal_correction(const bd_newton_system *system, const bd_plan *plan,
                                     double *c);
/* c, laid out as a state, becomes k: (1 - g J) k = g c. */
void bd_newton_solve(bd_newton_system *system, bd_plan *plan, double *c);

/* --- methods.c ---------------------------------------------------------------------------------
 */

enum { MAX_HISTORY = 2 }; /* earlier states that a multistep method may look back on */

/* A row of the table in methods.c: another method is another row, and the functions it names. */
typedef struct bd_method {
  const char *name;
  int implicit;
  int order;
  int error_order;  /* local errors go with this power of the step */
  int vectors;      /* of the size of the state, in bd_sim.stage */
  int history;      /* earlier states it looks back on */
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

/* --- implicit.c --------------------------------------------------------------------------------
 */

/* Sees that the Jacobian at y, and the rate, are there. */
int bd_sim_linearise(bd_sim *sim);
/* The set torques' change with time: over the step of length h, or at its start; and factor times
 * what it means for the pulleys, added to c. */
int bd_sim_torque_by_time(bd_sim *sim, double h, int at_start);
void bd_sim_add_torque_by_time(const bd_sim *sim, double *c, double factor);
/* At the end of a step: its ledger (middle: with the power in the step's middle), the next rate. */
int bd_sim_finish_step(bd_sim *sim, double h, double t_new, int middle);
/* The ledger's part of a state inside the step just made. */
void bd_sim_work_inside(const bd_sim *sim, double h, double s, double *y);

/* --- history.c ---------------------------------------------------------------------------------
 */

/* y_new becomes y, y the first of the past. */
void bd_history_push(bd_sim *sim, double h);
/* What happens to y after a step, whole turns taken off and friction forgotten, to the past, too.
 */
void bd_history_rebase(bd_sim *sim);

/* --- stiffness.c -------------------------------------------------------------------------------
 */

typedef struct bd_stiffness {
  double bound;     /* of |lambda| [1/s], everything together */
  const char *what; /* has the most to do with it */
  int pulley;       /* and which pulley, -1: none in particular */
} bd_stiffness;

/* load: may be NULL. */
bd_stiffness bd_stiffness_of(const bd_model *model, const bd_torque_set *set);

#endif
