/* SPDX-License-Identifier: MIT
 *
 * Evaluating the model: set torques, links near the pulleys, the right-hand side, what changes
 * between two steps, energy and outputs.
 */
#ifndef BELTDYN_PHYSICS_H
#define BELTDYN_PHYSICS_H

#include "model/model.h"

/* --- harmonics.c ----------------------------------------------------------------------------- */

/* A copy, whose arrays are carved. */
bd_harmonics bd_harmonics_carve(bd_carver *carver, const bd_harmonics *given);
/* whose: of which of the torque terms or motions, for the message. All n values of a name. */
int bd_check_finite(const char *field, const char *whose, size_t k, const char *name,
                    const double *values, size_t n, bd_error *err);
int bd_harmonics_check(const bd_harmonics *harmonics, const char *field, const char *whose,
                       size_t k, bd_error *err);
/* The sum at an angle, and its derivatives to it of order 1 to 3. */
void bd_harmonics_at(const bd_harmonics *harmonics, double angle, double sum[4]);
double bd_harmonics_highest(const bd_harmonics *harmonics); /* order */

/* --- torque.c -------------------------------------------------------------------------------- */

/* Prescribed motions, by motion; and, by pulley, whether it has one. */
typedef struct bd_motion_set {
  size_t n; /* 0: nothing of this is there */
  bd_motion *motions;
  int *of_pulley;
  double *theta, *omega, *alpha, *jerk; /* at the time `t`: angle (of calls for the speed: none), */
  double t, t_piece;                    /* and its derivatives */
  double *offset;                       /* the pulley's angle less that of its motion */
  double begin, end;                    /* of the run: calls are for no other time */
  int called;                           /* there are calls */
  int from_rate;         /* stages of a method whose order takes speeds that follow from rates */
  int ignored;           /* 1 + a pulley on which a torque was set all the same, */
  double ignored_torque; /* and that torque */
} bd_motion_set;

typedef struct bd_torque_set {
  int np;
  const bd_model *model; /* for the names of its pulleys, and the speeds within which they turn */
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
  bd_motion_set motion;
} bd_torque_set;

void bd_torque_set_carve(bd_carver *carver, bd_torque_set *set, const bd_model *model,
                         const bd_torque *torque);
int bd_torque_set_fill(bd_torque_set *set, const bd_torque *torque, bd_error *err);
/* t_piece: a time inside the present piece, which decides the side at a jump. BD_OK,
 * BD_ERR_CALLBACK or BD_ERR_TORQUE_VALUE. 0 for pulleys with a prescribed motion. */
int bd_torque_set_eval(bd_torque_set *set, double t, double t_piece, const double *theta,
                       const double *omega, double *torque, bd_error *err);
/* Derivatives at the same point, where the torque is `torque`: over one another, by row, (np, np)
 * to theta and omega; and to time, as the difference over dt (which stays inside the piece). */
int bd_torque_set_derive(bd_torque_set *set, double t, double t_piece, double *theta, double *omega,
                         const double *torque, double *by_theta, double *by_omega, bd_error *err);
int bd_torque_set_by_time(bd_torque_set *set, double t, double dt, double t_piece,
                          const double *theta, const double *omega, const double *torque,
                          double *slope, bd_error *err);

/* Upper bounds of what the known terms add to the stiffness and to the damping of pulley j, for the
 * speeds at which a belt under this tension can run [N m], [N m s]. */
void bd_torque_set_steepest(const bd_torque_set *set, int j, double tension, double *stiffness,
                            double *damping);
/* The longest step that still sees every harmonic turn, at these speeds: two values a period, for
 * fewer could as well be of a slower one. */
double bd_torque_set_longest(const bd_torque_set *set, const double *omega);

/* First of n ascending times above t; n if there is none. */
size_t bd_first_above(const double *times, size_t n, double t);
/* Between rows of `width` values at n times, a time given twice a jump, constant outside: adds them
 * to `out`; t_piece as above. */
void bd_add_interpolated(const double *times, const double *values, size_t n, size_t width,
                         double t, double t_piece, double *out);

/* --- loads.c --------------------------------------------------------------------------------- */

/* What LOAD, TABLE and HARMONICS give on the term's pulley, before its factor over time: the torque
 * and its derivatives to the pulley's speed, and to the angle of the pulley `of`. */
typedef struct bd_load_value {
  double torque, by_omega, by_theta;
} bd_load_value;

/* Fails for term k of a torque. */
#define BD_REFUSE_TERM(err, k, format, ...)                                                        \
  bd_fail(err, BD_ERR_TORQUE_DATA, "torque", "torque term %zu: " format, k, __VA_ARGS__)
int bd_is_load(const bd_torque_term *term);
int bd_has_points(const bd_torque_term *term); /* a table over speed */
int bd_load_check(const bd_torque_term *term, size_t k, int np, bd_error *err);
bd_load_value bd_load_at(const bd_torque_set *set, const bd_torque_term *term, const double *theta,
                         const double *omega);
double bd_load_factor(const bd_torque_term *term, double t, double t_piece);
void bd_load_steepest(const bd_torque_term *term, const bd_model *model, double tension,
                      double *stiffness, double *damping);
/* A term whose table the speed of its pulley is beyond, by more than a hundredth, while its factor
 * is not 0; NULL: none. */
const bd_torque_term *bd_load_beyond_table(const bd_torque_set *set, double t, double t_piece,
                                           const double *omega);

/* --- motion.c -------------------------------------------------------------------------------- */

void bd_motion_set_carve(bd_carver *carver, bd_motion_set *set, int np, const bd_torque *torque);
int bd_motion_set_check(bd_motion_set *set, int np, bd_error *err);
/* The motions at a time, into the set. BD_OK, BD_ERR_CALLBACK or BD_ERR_TORQUE_VALUE. */
int bd_motion_set_eval(bd_torque_set *set, double t, double t_piece, bd_error *err);
static inline int bd_is_moved(const bd_torque_set *set, int j) {
  return set->motion.n > 0 && set->motion.of_pulley[j];
}
/* Whether motion k says what the angle is, and not the speed alone. */
static inline int bd_knows_angle(const bd_motion_set *set, size_t k) {
  return set->motions[k].kind != BD_MOTION_SPEED;
}

/* --- search.c -------------------------------------------------------------------------------- */

typedef struct bd_search {
  double margin;    /* how far outside a pulley links are still listed [m] */
  double travelled; /* how far a link can have gone since the list was made */
  long rebuilds;
  int *n_runs;  /* per pulley */
  bd_run *runs; /* per pulley, max_runs apart */
  int max_runs;
  double step; /* how far one can go within the step that begins */
} bd_search;

void bd_search_carve(bd_carver *carver, bd_search *search, const bd_layout *lay);

/* --- effects.c ------------------------------------------------------------------------------- */

/* The longest: with every law. */
#define BD_LAW_TEXT(name, class, general, states, text) " with " text
#define BD_CONTACT_NAME "contact" BD_LAWS(BD_LAW_TEXT) " without friction"

typedef struct bd_plan_options {
  int ledger, friction, hold_pulleys, no_power, motion;
  int settling; /* not a run: without what acts in runs alone */
  double mass_damping;
  const double *offset;
  double move_time;
  double flow; /* settling: stress-free length of belt that runs past a point [m/s] */
} bd_plan_options;

/* An axis that moves with a body (-1: it stands): speed of the body, and where it has the axis. */
typedef struct bd_moving_axis {
  int body;
  double speed;
  bd_place at;
} bd_moving_axis;

/* A mount as linearised: stiffness and damping of all but the belt's contact, what turning the
 * direction does to the force of the belt included; friction, and the rate of its share by speed
 * and, of opposite sign, by the share. */
typedef struct bd_mount_tangent {
  double stiffness, damping, friction, gain, decay;
} bd_mount_tangent;

/* A coupling as linearised: of its torque by windup and speed, and of the rate of its windup by the
 * speed of the rim, 0 or its sense, and, of opposite sign, by itself. */
typedef struct bd_coupling_tangent {
  double stiffness, damping, winds, decay;
} bd_coupling_tangent;

/* The effects' derivatives at a state, as the implicit methods keep them. */
typedef struct bd_derivatives {
  bd_tangent joints;
  bd_contact_pulley *contact_pulleys; /* where contact is to be linearised: pulleys, links near */
  int *n_runs;
  bd_run *runs; /* per pulley, max_runs apart */
  int max_runs;
  double ahead;         /* contact that comes about while links go so far has a part as well */
  double mass_damping;  /* [1/s] */
  bd_moving_axis *axes; /* by pulley; NULL: all stand */
  double *bearings;     /* by pulley: of drag by the speed of the shaft against them [N m s] */
  bd_mount_tangent *mounts;
  bd_coupling_tangent *couplings;
} bd_derivatives;

/* A body of one degree of freedom; by number shafts, then mounts, then rims and rings with a
 * coupling. Entries of its place and speed in a state; whether its motion is prescribed; the radius
 * or lever at which the belt has hold of it. */
typedef struct bd_freedom {
  int pulley, place, speed;
  double inertia;
  int prescribed;
  double arm;
} bd_freedom;

static inline const bd_moving_axis *bd_moving_axis_of(const bd_derivatives *at, int j) {
  return at->axes && at->axes[j].body >= 0 ? &at->axes[j] : NULL;
}

static inline int bd_count_bodies(const bd_layout *lay) {
  return lay->np + lay->nm + lay->nc;
}
bd_freedom bd_freedom_of(const bd_plan *plan, int body);

/* A step to t, of length h, asked for what its method has not seen: an implicit one solved a linear
 * system with g, an explicit one has g = h. */
typedef struct bd_step {
  double t, h, g;
  const double *y, *y_new, *weights;
  int implicit;
} bd_step;

typedef struct bd_stiffness {
  double bound;     /* of |lambda| [1/s], everything together */
  const char *what; /* has the most to do with it */
  int pulley;       /* and which pulley, -1: none in particular */
} bd_stiffness;

/* What makes a drive stiff, as its effects say at one pulley after the other (stiffness.c). */
typedef struct bd_stiffening {
  const bd_model *model;
  const bd_torque_set *set; /* NULL: not known */
  int pulley;
  double tension, normal; /* of the belt, on a link [N] */
  double wrap;
  double inertia; /* of the shaft, infinite if its motion is prescribed */
  double stiffness[2], damping[2], bound;
  bd_stiffness most, own;
} bd_stiffening;

/* A part of it, an oscillator of unit mass: of a LINK, or of the PULLEY, to which the others add;
 * or a body of its OWN. adapts: the rate of something in it that is none, or 0 [1/s]. */
enum { BD_STIFF_LINK, BD_STIFF_PULLEY, BD_STIFF_OWN };
void bd_stiffen(bd_stiffening *at, int of, const char *what, double stiffness, double damping,
                double adapts);

/* A work integral in the state's tail, W_...; of what is lost in dampers the name of its column,
 * what messages say if energy came from there, and whether no power ever may. */
typedef struct bd_work {
  int row;
  const char *name, *given;
  int never;
} bd_work;

#define BD_LOST_IN(name, given, never)                                                             \
  { W_##name, #name, given, never }

/* Into which an effect tells the Jacobian of its states: an entry; a state whose column is what the
 * passes of solves make of it (solvers/jacobian.c). */
typedef struct bd_state_entries {
  void (*put)(const void *reading, int row, int column, double value);
  void (*column)(const void *reading, int state);
  const void *reading;
} bd_state_entries;

/* An effect is a row, which stands with its functions; what is NULL or 0 it does not have. Another
 * effect is another row, and its name in BD_EFFECTS. */
typedef struct bd_effect {
  const char *name;
  /* What in a scene calls for it: groups of parameters, or gravity, motion, torque, friction; NULL:
   * settling alone has it. */
  const char *asked_by;
  /* What result.effects calls it, of a plan; NULL: by its name. */
  const char *(*label)(const bd_plan *plan);
  int (*enabled)(const bd_model *model, const bd_plan_options *options);
  /* Adds what it does to the rate dy at y, and sets the power of its works. */
  int (*rate)(bd_plan *plan, double t, double *y, double *dy, bd_error *err);
  /* Keeps its derivatives at y, whose rate was the last to be evaluated. NULL: they are not known,
   * and implicit methods refuse the effect by its name (newton_system.c). */
  void (*tangent)(const bd_plan *plan, const double *y, bd_derivatives *out);
  /* Scratch of its pass, and of its derivatives, in models that can have it. */
  void (*carve)(bd_carver *carver, bd_plan *plan, const bd_model *model);
  void (*carve_tangent)(bd_carver *carver, bd_derivatives *out, const bd_model *model);
  /* Its part in linear systems with g, beside inertias, damping and what the links do: its entries,
   * added to the small matrix of all bodies (n, n); what c, laid out as a state, adds to their
   * right-hand side and what it takes off; and its unknowns into c, from the speeds of all bodies.
   */
  void (*entries)(const bd_plan *plan, const bd_derivatives *at, double g, int n, double *w);
  void (*product)(const bd_plan *plan, const bd_derivatives *at, double g, const double *c,
                  double *rhs, double *off);
  void (*finish)(const bd_plan *plan, const bd_derivatives *at, double g, const double *rhs,
                 double *c);
  /* Rates of its own states as entries of the Jacobian, and the states by which forces go. */
  void (*states)(const bd_derivatives *at, const bd_layout *lay, const bd_state_entries *to);
  /* What happens to y between two steps. *changed: so much, over the scale of errors more than
   * `tolerance`, that rates must be taken anew. */
  int (*after_step)(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                    bd_error *err);
  /* What a step has not seen of it, as an error over the weights: a linear system whatever leaves
   * the line along which it was linearised, any step what comes and goes within it. */
  double (*unseen)(const bd_plan *plan, const bd_step *step);
  /* What it has to do with how stiff a pulley is. */
  void (*stiffness)(bd_stiffening *at);
  /* Its states in y as settling begins with them, the belt being at rest. */
  void (*rest)(const bd_plan *plan, double *y);
  /* Torque on the shaft of pulley j, counter-clockwise; what a prescribed motion needs besides. */
  double (*on_shaft)(const bd_plan *plan, const double *y, int j);
  /* Row k of its outputs. */
  void (*outputs)(bd_plan *plan, const double *y, const bd_output *out, size_t k);
  /* Adds the energy it stores at y to the terms. */
  void (*energy)(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]);
  int n_works;
  bd_work works[2];
  int calls; /* its pass may call functions of the caller's: torques, motions */
  int store; /* column of the ledger of its own, BD_ENERGY_... */
} bd_effect;

/* In the order of their passes: joints set the links' rates, and the pulleys' pass those of the
 * pulleys, others add to them; mass-proportional damping sees the accelerations of all. */
#define BD_EFFECTS(X)                                                                              \
  X(moving_centres)                                                                                \
  X(joints)                                                                                        \
  X(gravity)                                                                                       \
  X(centrifugal)                                                                                   \
  X(motion)                                                                                        \
  X(axes)                                                                                          \
  X(contact)                                                                                       \
  X(pulleys)                                                                                       \
  X(couplings)                                                                                     \
  X(drag)                                                                                          \
  X(mounts)                                                                                        \
  X(paths)                                                                                         \
  X(motion_torques)                                                                                \
  X(mass_damping)

#define X(name) extern const bd_effect bd_effect_##name;
BD_EFFECTS(X)
#undef X

enum {
#define X(name) BD_EFFECT_##name,
  BD_EFFECTS(X)
#undef X
      BD_MAX_EFFECTS
};

/* The effects that this model and these options have, in the order of their passes; how many. */
int bd_effects_of(const bd_model *model, const bd_plan_options *options,
                  const bd_effect *effects[BD_MAX_EFFECTS]);
int bd_effect_row(const bd_effect *effect); /* of the table */
/* The scratch of all that this model can have. */
void bd_effects_carve(bd_carver *carver, bd_plan *plan, const bd_model *model);
void bd_effects_carve_tangents(bd_carver *carver, bd_derivatives *out, const bd_model *model);
/* What all that this model can have makes of y as settling begins, the belt being at rest. */
void bd_effects_rest(const bd_plan *plan, double *y);
/* Of effects that do not depend on the state, or whose derivatives are taken elsewhere. */
void bd_tangent_none(const bd_plan *plan, const double *y, bd_derivatives *out);

/* --- settling.c ------------------------------------------------------------------------------- */

/* Speed of circulation, from the velocities of y, or the accelerations of a rate. */
double bd_plan_circulation(const bd_plan *plan, const double *y);

/* --- drag.c ---------------------------------------------------------------------------------- */

/* omega_0 of pulley j, within which the smooth sign of its speed turns. */
double bd_turning_speed(const bd_model *model, int j);
/* A torque against rotation with omega > 0, and its derivative to omega. */
typedef struct bd_resisting {
  double torque, slope;
} bd_resisting;

/* `size` times the smooth sign, omega / sqrt(omega^2 + w0^2). */
bd_resisting bd_coulomb_drag(double size, double omega, double w0);
/* All that a bd_drag says, of bearings or of a load; and a bound of its derivative for the speeds
 * at which a belt under this tension can run. */
bd_resisting bd_resistance(const bd_drag *drag, double omega, double w0);
double bd_steepest_resistance(const bd_drag *drag, const bd_model *model, int j, double tension);
/* What a step has not seen of all that resists pulleys by their own speed, drag and loads. */
double bd_resistance_unseen(const bd_plan *plan, const bd_step *step);
/* --- mounts.c -------------------------------------------------------------------------------- */

/* The axes of pulleys on mounts where y has them. Before contact is asked of any other state than
 * that of the last rate. */
void bd_mounts_put(const bd_plan *plan, const double *y);
/* Of mount m at y, in the sense of its travel: of the belt. */
double bd_mount_belt_force(const bd_plan *plan, const double *y, int m);
/* Mounts that have come from y to y_new to a stop which throws them back. */
long bd_bounces(const bd_plan *plan, const double *y, const double *y_new);
/* At the start of a run: axes on a path must stand where it has them at t; their rate is set. */
int bd_mounts_begin(const bd_plan *plan, double t, double *y, bd_error *err);

/* --- couplings.c ------------------------------------------------------------------------------ */

/* Bodies of the linear systems: shafts, mounts, rims with a coupling; that on which the belt runs
 * at pulley j. */
static inline int bd_rim_body(const bd_layout *lay, int c) {
  return lay->np + lay->nm + c;
}
static inline int bd_belt_body(const bd_layout *lay, int j) {
  return bd_runs_on_shaft(lay, j) ? j : bd_rim_body(lay, lay->rim[j] - lay->rim_speed);
}

/* --- stiffness.c ------------------------------------------------------------------------------ */

/* |lambda| of an oscillator of unit mass. */
double bd_oscillator_rate(double stiffness, double damping);

/* set: may be NULL. */
bd_stiffness bd_stiffness_of(const bd_model *model, const bd_torque_set *set);

/* --- plan.c ---------------------------------------------------------------------------------- */

/* What one evaluation of the right-hand side needs: the effects in order, and their scratch. An
 * effect that is off is not among them. */
struct bd_plan {
  const bd_model *model;
  const bd_kernels *kernels;
  bd_links links;
  bd_contact_pulley *contact_pulleys;
  bd_pressure pressure; /* contact along links: scratch, */
  bd_end_forces forces;
  bd_points points; /* the joints as last evaluated, */
  double *nearest;  /* squared distance of each link's nearer end from a pulley, */
  bd_links seen;    /* and the links with directions of any other state than the rate's */
  bd_joint *joints; /* scratch of the outputs, by node, */
  bd_touch *touches;
  struct bd_ale_belt *ale; /* of an ALE belt, belts/ale.h */
  double *owner;           /* pulley that holds a friction slot, -1: none; (slots, n8) */
  bd_search search;
  bd_torque_set torques;
  double *torque;        /* M_d of the last evaluation */
  double *friction;      /* friction torque on each pulley */
  double *best;          /* per link: of contact, then of spans; */
  int32_t *touched;      /* and the pulley it touches */
  double *hub;           /* force of the belt on each pulley with a mount (mounts, 2) */
  double *mount_inertia; /* of mounts; settling takes what makes them come to rest soonest */
  double t_piece;
  long contacts_changed; /* links that have come to a pulley or left it, with friction on */
  int skip_power;        /* power is not evaluated now: stages that do not need it */
  int ledger, friction_on, bending_on;
  int grip_on;                      /* friction of mounts */
  int no_power;                     /* power is never evaluated: settling, runs beside the run */
  int pulleys_locked;               /* settling: pulleys stand still */
  double mass_damping;              /* settling: mass-proportional damping [1/s] */
  double circulation_damping;       /* settling: the same of circulation */
  double circulation_inertia_scale; /* settling: what multiplies the inertia of circulation */
  const double *offset;             /* settling: the centres' displacement at the start */
  double move_time;
  double flow; /* settling: stress-free length of belt that runs past a point [m/s] */
  char contact_name[sizeof(BD_CONTACT_NAME)]; /* of the contact's pass, with the laws of friction */
  int n_columns, columns[BD_N_ENERGY];        /* of the output `energy` */
  int n_effects;
  const bd_effect *effects[BD_MAX_EFFECTS];
};

/* The links listed near pulley j. */
static inline const bd_run *bd_runs_of(const bd_plan *plan, int j) {
  return plan->search.runs + j * plan->search.max_runs;
}

/* Goes through the links listed near pulley j: the first one after i, -1 past the last; *run is 0
 * and i -1 at the beginning. */
static inline int bd_next_near(const bd_plan *plan, int j, int *run, int i) {
  const bd_run *runs = bd_runs_of(plan, j);
  for (++i; *run < plan->search.n_runs[j]; ++*run) {
    i = i > runs[*run].begin ? i : runs[*run].begin;
    if (i < runs[*run].end && i < plan->model->lay.n) {
      return i;
    }
  }
  return -1;
}

void bd_plan_carve(bd_carver *carver, bd_plan *plan, const bd_model *model);
void bd_plan_make(bd_plan *plan, const bd_model *model, const bd_plan_options *options);
int bd_plan_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err);
/* The same, powers included, without set torques and prescribed motions: no function is called. */
int bd_plan_rate_of_belt(bd_plan *plan, double t, double *y, double *dy, bd_error *err);
/* Centres at time t and in the state y into the contact_pulleys (they stand still unless they have
 * mounts or settling moves them). */
void bd_plan_place(bd_plan *plan, double t, const double *y);
/* Which pulley holds each friction slot, from positions alone, at the start of a run; friction
 * states of links on no pulley are reset. */
void bd_plan_assign_contacts(bd_plan *plan, double *y);
/* Before contact is asked of any other state than that of the last rate: directions there. Before
 * the distances of nodes in these runs from a pulley are. */
void bd_plan_see(const bd_plan *plan, const double *y);
void bd_plan_near(const bd_plan *plan, const double *y, int j, int n_runs, const bd_run *runs);
/* Squared distances from pulley j of all that touches at the nodes, after bd_plan_see. Scratch. */
const double *bd_plan_distances(const bd_plan *plan, const double *y, int j);
/* What of the effects a step has not seen, the largest. */
double bd_plan_unseen(const bd_plan *plan, const bd_step *step);
/* Its norm, infinite if any of it is not finite. */
double bd_plan_error(const bd_plan *plan, const bd_step_sum *of);
/* What the effects make of y after a step. */
int bd_plan_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                       bd_error *err);
/* MODEL section 4 after a step: the friction state of a link off its pulley is reset, and that of
 * others brought within its bound. *changed: by more than `tolerance`, so that the rates must be
 * taken anew. Fails when a link has sunk past half a pulley's radius. */
int bd_contact_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                          bd_error *err);

/* --- motion.c, on a plan --------------------------------------------------------------------- */

/* The prescribed speeds at t, and angles that are known, into y. */
int bd_motion_put(bd_plan *plan, double t, double *y, bd_error *err);
/* At the start of a run from t to t_end: the speeds of y must be those prescribed, angles go on
 * from those of y. */
int bd_motion_begin(bd_plan *plan, double t, double t_end, const double *y, bd_error *err);
/* In place of set torques those that the motions last evaluated need at y. */
void bd_outputs_of_motion(bd_plan *plan, const double *y, const bd_output *out, size_t k);

static inline void bd_plan_list(bd_plan *plan, const double *y, double h) {
  plan->model->belt_model->list(plan, y, h);
}

static inline void bd_plan_begin(bd_plan *plan, double *y) {
  plan->model->belt_model->begin(plan, y);
}

/* --- search.c, on a plan --------------------------------------------------------------------- */

/* Runs of all links within `margin` of touching pulley j, and of those beside them: joints have
 * contact of both their links, derivatives by a link those of both its joints. Looked for in the
 * runs `within`. Their number. */
int bd_search_near(const bd_plan *plan, const double *y, int j, double margin, int n_within,
                   const bd_run *within, bd_run *runs);
/* Keeps the search list right for a step of length h from y: every link that can touch a pulley
 * within the step is listed. */
void bd_search_ready(bd_plan *plan, const double *y, double h);

/* --- outputs.c ------------------------------------------------------------------------------- */

/* Row k of the outputs from a state (its halo is set here) and the torques at that time. */
void bd_observe(bd_plan *plan, double *y, double turns, const double *torque, double e0,
                const bd_output *out, size_t k);
/* Torque of friction on pulley j at a state; and, unless NULL, the force of its contact on the
 * belt, friction included. */
double bd_friction_torque(const bd_plan *plan, const double *y, int j, double force[2]);
/* All joints at a state, with directions as the rate has them or anew. Scratch. */
const bd_joint *bd_joints(const bd_plan *plan, const double *y, int with_rate);
/* A value of an output, NULL: it is not wanted. */
static inline void bd_put(double *to, size_t at, double value) {
  if (to) {
    to[at] = value;
  }
}
/* Outputs of single effects. */
void bd_outputs_of_joints(bd_plan *plan, const double *y, const bd_output *out, size_t k);
/* All works but that of the set torques: what was lost since the start. */
double bd_losses(const bd_layout *lay, const double *y);
/* Mean of the joint forces, tension positive. */
double bd_mean_force(const bd_plan *plan, const double *y);
/* E of MODEL section 7; its terms, and the works since the start. touched (NULL: not wanted): of
 * pulleys that the belt touches it becomes t. */
double bd_energy(const bd_plan *plan, double t, const double *y, const bd_joint *joints,
                 double *touched, double terms[BD_N_ENERGY]);

#endif
