/* SPDX-License-Identifier: MIT
 *
 * beltdyn: dynamics of belt drives. The public C interface; needs nothing but C11 and libm.
 *
 * A *scene* (plain structs the caller fills) becomes a *model* (constant), a model and a state
 * become a *simulation*, which is advanced in chunks:
 *
 *   bd_model_create -> bd_settle_create or bd_sim_create -> bd_sim_advance ... -> bd_sim_state
 *
 * SI units, angles in rad, counter-clockwise positive. Every function that can fail returns a
 * code: BD_OK, BD_MORE (not finished, call again) or a negative BD_ERR_...; the bd_error given (or
 * NULL) then says which field, rule, time, body and pulley. Nothing is allocated while running,
 * nothing is global: different simulations may run in different threads, sharing one model.
 */
#ifndef BELTDYN_H
#define BELTDYN_H

#include <stddef.h>
#include <stdint.h>

#include "fields.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BD_VERSION "0.1.0"

/* --- errors ---------------------------------------------------------------------------------- */

enum {
  BD_OK = 0,
  BD_MORE = 1,
  BD_ERR_FIRST = -100,
#define X(symbol, kind, text) symbol,
  BD_ERRORS(X)
#undef X
};

enum { BD_KIND_MEMORY, BD_KIND_VALUE, BD_KIND_USE, BD_KIND_CALL, BD_KIND_RUN };

typedef struct bd_error {
  int code;
  double t;     /* time of the failure [s], NaN if none */
  int body;     /* link index, -1 if none */
  int pulley;   /* pulley index, -1 if none */
  double value; /* the offending value, NaN if none */
  char field[64];
  char message[512]; /* one sentence: the field, the rule, the value; for runs what to try */
} bd_error;

const char *bd_error_symbol(int code);
const char *bd_error_text(int code);
int bd_error_kind(int code);

/* --- warnings -------------------------------------------------------------------------------- */

enum {
#define X(code, accuracy, text) BD_WARN_##code,
  BD_WARNINGS(X)
#undef X
      BD_N_WARNINGS
};

typedef struct bd_warning {
  int code;   /* BD_WARN_... */
  double t;   /* when it was seen first [s], NaN: it holds for the whole run */
  int body;   /* link index, -1 if none */
  int pulley; /* pulley index, -1 if none */
  char message[512];
} bd_warning;

const char *bd_warning_code(int code);
int bd_warning_accuracy(int code);

/* --- scene ----------------------------------------------------------------------------------- */

/* Discretisations in space (MODEL section 3): the paper's as a whole, with contact of the links'
 * centres; contact of the joints, with the links' mass at their ends; a mesh that stands where the
 * pulleys are, through which the belt flows (arbitrary Lagrangian-Eulerian), of some n_bodies
 * cells.
 */
enum { BD_MESH_PAPER, BD_MESH_JOINT, BD_MESH_ALE };

/* What the belt is made of (MODEL section 2): rigid links; a string of point masses, which resists
 * no bending; a string where there is no bending and the mesh is BD_MESH_JOINT, else links. */
enum { BD_BELT_AUTO, BD_BELT_LINKS, BD_BELT_STRING };

/* The belt models that there are, and the facts of one. */
enum {
#define X(symbol) BD_BELT_MODEL_##symbol,
  BD_BELTS(X)
#undef X
      BD_N_BELT_MODELS
};

typedef struct bd_belt_facts {
#define X(name, text) const char *name;
  BD_BELT_TEXTS(X)
#undef X
#define X(type, name, text) type name;
  BD_BELT_FACTS(X)
#undef X
  int mesh, model; /* of a bd_belt that asks for it: BD_MESH_..., BD_BELT_... */
  unsigned fields; /* of BD_STATE_FIELDS, those before THETA that its states have: a bit each */
  unsigned lacks;  /* of BD_SIZES those of which it has none: a bit each */
} bd_belt_facts;

const bd_belt_facts *bd_belt_facts_at(int row); /* BD_BELT_MODEL_...; NULL: there is none */

#define X(group, name, rule, unit, text) BD_TYPE_##rule name;
typedef struct bd_belt {
  BD_BELT(X)
  int mesh;  /* BD_MESH_... */
  int model; /* BD_BELT_... */
} bd_belt;

/* Torque against the rotation: coulomb s(omega) + viscous omega + quadratic omega |omega|, s a
 * smooth sign (MODEL section 5). All 0: none. */
typedef struct bd_drag {
  BD_DRAG(X)
} bd_drag;

typedef struct bd_contact {
  BD_CONTACT(X)
} bd_contact;

/* What lets the axis of a pulley move (MODEL section 5): an arm turns about its pivot, a slider
 * goes along its direction (of any length), a path is prescribed: displacements (n_t, 2) from the
 * pulley's center at times t (n_t >= 2, increasing), the first one none, joined by a cubic spline
 * that is at rest at both ends. Those that move have numbers of their group, the others 0. */
typedef struct bd_sprung {
  double inertia, mass, weight;
  BD_SPRUNG(X, sprung, , , , , )
} bd_sprung;

#define BD_MOUNT_TYPE(KIND, name) typedef bd_sprung bd_##name;
#define BD_MOUNT_ROW(KIND, name) BD_MOUNT_##KIND,
BD_MOUNTS(BD_MOUNT_TYPE)
enum { BD_MOUNTS(BD_MOUNT_ROW) BD_N_MOUNTS }; /* of the table in mount.c */

typedef struct bd_mount {
  int kind; /* BD_MOUNT_... */
  bd_sprung numbers;
  double guide[2]; /* pivot or direction */
  size_t n_t;
  const double *t, *displacement; /* copied */
} bd_mount;

/* What joins a pulley's shaft, on which torques, drag and prescribed motions act, to its rim, on
 * which the belt runs (MODEL section 5); of a damper belt and torques act on the pulley, and the
 * ring hangs free. */
#define KIND(KIND, name)                                                                           \
  typedef struct bd_##name {                                                                       \
    BD_##KIND(X)                                                                                   \
  } bd_##name;
BD_COUPLINGS(KIND)
#undef KIND

enum {
#define KIND(KIND, name) BD_COUPLING_##KIND,
  BD_COUPLINGS(KIND)
#undef KIND
      BD_N_COUPLINGS
};

typedef struct bd_coupling {
  int kind; /* BD_COUPLING_... */
  union {
#define KIND(KIND, name) bd_##name name;
    BD_COUPLINGS(KIND)
#undef KIND
  };
} bd_coupling;

const char *bd_coupling_name(int kind); /* of its group of parameters; NULL: there is none */

/* A parameter that is a list: of an element of a friction law each; all lists of a law are of one
 * length. */
enum { BD_MAX_ELEMENTS = 64 };
typedef struct bd_numbers {
  int n;
  double at[BD_MAX_ELEMENTS];
} bd_numbers;

/* bd_dahl, bd_lugre, ...: the parameters of each friction law. */
#define LAW(name, class, general, states, text)                                                    \
  typedef struct bd_##name {                                                                       \
    BD_LAW_##name(X)                                                                               \
  } bd_##name;
BD_LAWS(LAW)
#undef LAW

enum {
  BD_LAW_NONE,
#define LAW(name, class, general, states, text) BD_LAW_##name,
  BD_LAWS(LAW)
#undef LAW
      BD_N_LAWS
};

/* A friction law with its parameters: {.law = BD_LAW_dahl, .dahl = {.mu_k = 1.0, .sigma = 1e4}}. */
typedef struct bd_friction {
  int law; /* BD_LAW_... */
  union {
#define LAW(name, class, general, states, text) bd_##name name;
    BD_LAWS(LAW)
#undef LAW
  };
} bd_friction;

typedef struct bd_pulley {
  double center[2];
  BD_PULLEY(X)
  bd_drag drag;
  const bd_friction *friction; /* NULL: that of the scene; BD_LAW_NONE: no friction here */
  int outside;                 /* of the loop, on the back of the belt */
  const char *name;            /* in messages; NULL: none; at most BD_MAX_NAME bytes of UTF-8 */
  const bd_mount *mount;       /* NULL: the axis is fixed */
  const bd_coupling *coupling; /* NULL: shaft and rim are one */
} bd_pulley;
#undef X

/* The belt visits the pulleys in their order, those inside its loop turning with it and those
 * outside against it; of two pulleys, one of them outside, it is crossed. It begins where it leaves
 * pulley 0, which is inside; one or two pulleys: clockwise. friction NULL: none on pulleys that
 * have none of their own; without any there is no friction state either. */
typedef struct bd_scene {
  bd_belt belt;
  int n_pulleys;
  const bd_pulley *pulleys;
  bd_contact contact;
  const bd_friction *friction;
  double gravity[2];
} bd_scene;

/* Sizes up to which all counting stays within an int. */
#define BD_MAX_LINKS 1000000
#define BD_MAX_PULLEYS 1000
#define BD_MAX_NAME 31

/* --- model ----------------------------------------------------------------------------------- */

typedef struct bd_model bd_model;

/* Checks every parameter on its own (BD_PARAMETERS) and derives the constants per link. */
int bd_model_create(bd_model **out, const bd_scene *scene, bd_error *err);
void bd_model_free(bd_model *model);

/* Checks that the belt can run on the pulleys: they do not overlap, each is reached, the belt is
 * neither too long (slack) nor too short (strain above BD_MAX_STRAIN). */
#define BD_MAX_STRAIN 0.25
int bd_model_check_geometry(const bd_model *model, bd_error *err);

typedef struct bd_info {
#define X(type, name, text) type name;
  BD_INFO(X)
#undef X
  unsigned lacks; /* of BD_SIZES those of which its belt has none: a bit each */
} bd_info;

void bd_model_info(const bd_model *model, bd_info *info);

enum {
#define X(size, count) BD_SIZE_##size,
  BD_SIZES(X)
#undef X
      BD_N_SIZES
};

/* How many values a field or an output of this size has in such a model. */
size_t bd_size(const bd_info *of, int size);
const char *bd_size_name(int size); /* NULL past the last */

int bd_model_belt(const bd_model *model); /* row of its belt, BD_BELT_MODEL_... */
/* Of a belt that flows through cells, by cell (n_bodies): its pulley, -1 in spans; the share of the
 * wrap, 0 in spans, that is behind where it begins. Returns whether it is such a belt: of others
 * nothing is written. */
int bd_model_cells(const bd_model *model, int32_t *pulley, double *share);
/* Travels of the mounts (n_mounts) in equilibrium with the belt; where there is none
 * (bd_model_check_geometry) those of the scene, 0. Centres of all pulleys (n_p, 2) [m] at travels.
 */
void bd_model_rest(const bd_model *model, double *travel);
void bd_model_centers(const bd_model *model, const double *travel, double *centers);
/* Force (torque) of spring, hung weight and stops on each mount that stands at these travels, in
 * the sense of the travel (n_mounts); of paths 0. */
void bd_model_mount_forces(const bd_model *model, const double *travel, double *force);
/* Depth to which the belt sinks into a pulley of a radius under a tension at a speed [m]: the root
 * p of c1' p^2 + c2' p = (T lambda - rho v^2) / R (MODEL section 3), 0 where nothing presses. */
double bd_model_depth(const bd_model *model, double radius, double tension, double speed);
/* Numbers of mount m, of coupling c as they act, given or chosen. */
#define X(name, text) double name;
typedef struct bd_mount_numbers {
  BD_MOUNT_NUMBERS(X)
} bd_mount_numbers;

typedef struct bd_coupling_numbers {
  BD_COUPLING_NUMBERS(X)
} bd_coupling_numbers;
#undef X

bd_mount_numbers bd_model_mount(const bd_model *model, int m);
bd_coupling_numbers bd_model_coupling(const bd_model *model, int c);

/* What messages call a pulley: pulley "crank", or pulley 3 if it has no name. */
typedef struct bd_label {
  char text[96];
} bd_label;

bd_label bd_pulley_label(const bd_model *model, int pulley);
/* Of what has states of its own along the belt: a link, or a cell. */
bd_label bd_body_label(const bd_model *model, int body);

/* The tight belt line at one pulley: the angle seen from its axis at which the belt arrives, and
 * that over which it lies, > 0, so that it leaves at arrive + sense wrap [rad]; the sense in which
 * it turns there as its links are numbered, +1 counter-clockwise, -1 clockwise; and the length of
 * the free span that follows [m]. */
typedef struct bd_wrap {
  double arrive, wrap, span;
  int sense;
} bd_wrap;

/* The belt line round pulleys, which needs no belt: their wraps, its length [m] and the turns that
 * it makes, -1 clockwise, +1 counter-clockwise, 0 crossed. BD_ERR_GEOMETRY names what hinders it.
 */
int bd_belt_line(int n_pulleys, const bd_pulley *pulleys, bd_wrap *wraps, double *length,
                 int *turns, bd_error *err);

/* All parameters, those of the friction laws among them: the table of fields.h, with the place of
 * each in the struct of its group. */
enum { BD_IS_NUMBER, BD_IS_INTEGER, BD_IS_LIST };
typedef struct bd_parameter {
  const char *group, *name, *unit, *text;
  int rule, kind; /* BD_IS_NUMBER: double, BD_IS_INTEGER: int, BD_IS_LIST: bd_numbers */
  size_t offset;
} bd_parameter;

extern const bd_parameter bd_parameters[];
extern const size_t bd_n_parameters;

/* One parameter, of a group of BD_PARAMETERS, against its rule; `label` is what messages call the
 * group ("pulleys[1].drag"), NULL: as it is. */
int bd_check_parameter(const char *group, const char *name, const char *label, double value,
                       bd_error *err);

/* --- state ----------------------------------------------------------------------------------- */

/* Arrays owned by the caller, sizes as BD_STATE_FIELDS (bd_size), those of slots slot-major. phi is
 * continuous: joint 0 carries the winding. */
typedef struct bd_state {
  double t;
#define X(symbol, name, size, scale, unit, text) double *name;
  BD_STATE_FIELDS(X)
#undef X
} bd_state;

/* --- torque ---------------------------------------------------------------------------------- */

typedef void (*bd_torque_function)(double t, const double *theta, const double *omega,
                                   double *torque, void *user);
/* The same, but may stop the run by returning non-zero: BD_ERR_CALLBACK. */
typedef int (*bd_torque_call)(double t, const double *theta, const double *omega, double *torque,
                              void *user);

/* The sum of amplitudes[k] cos(orders[k] angle + phases[k]), n of them; orders > 0. */
typedef struct bd_harmonics {
  size_t n;
  const double *orders, *amplitudes, *phases;
} bd_harmonics;

enum {
  BD_TORQUE_PIECEWISE,
  BD_TORQUE_VISCOUS,
  BD_TORQUE_FUNCTION,
  BD_TORQUE_CALL,
  BD_TORQUE_LOAD,
  BD_TORQUE_TABLE,
  BD_TORQUE_HARMONICS,
  BD_TORQUE_CURVE
};

/* One term; terms add up. PIECEWISE: linear between the times t (n_t, non-decreasing; a time given
 * twice is a jump), values (n_t, n_p) row-major, constant outside. VISCOUS: -coefficients[j] *
 * omega[j].
 *
 * The others are torques on one pulley, times a factor over time, `values` (n_t) at t as above, or
 * 1 if n_t is 0. LOAD: `against` its rotation. TABLE: against its rotation too, `torque` over the
 * magnitude `omega` of its speed (n_points, increasing, >= 0), linear between its points, constant
 * outside. HARMONICS: over the angle of pulley `of`. CURVE: `torque` over its speed `omega`, both
 * counter-clockwise positive. Signs of speeds are smooth (MODEL section 5).
 *
 * Arrays are copied when the simulation is made. */
typedef struct bd_torque_term {
  int kind;
  size_t n_t;
  const double *t, *values;
  const double *coefficients;
  bd_torque_function function;
  bd_torque_call call;
  void *user;
  int pulley, of;
  bd_drag against;
  size_t n_points;
  const double *omega, *torque; /* [rad/s], [N m], of TABLE both >= 0 */
  bd_harmonics harmonics;       /* amplitudes [N m] */
} bd_torque_term;

/* Value of a motion at a time; non-zero stops the run: BD_ERR_CALLBACK. A function of time alone:
 * it is called several times round each time (for derivatives), never outside the run, and again by
 * the simulation that runs beside a run (growth.c). */
typedef int (*bd_motion_call)(double t, double *value, void *user);

enum { BD_MOTION_PIECEWISE, BD_MOTION_SPEED, BD_MOTION_ANGLE };

/* Prescribed motion of a pulley, at most one each (MODEL section 5). PIECEWISE: its speed, linear
 * between the times t (n_t, increasing), constant outside. SPEED, ANGLE: its speed, or its angle
 * but for a constant, by calls. A speed must be continuous, and at the start that of the initial
 * state. Where a function kinks is to be named in the breakpoints.
 *
 * With harmonics, the speed of PIECEWISE is the mean one, and the angle that follows from it, 0 at
 * t[0], fluctuates by them; they fade in between the times fade[0] and fade[1], and are there from
 * the beginning if these are the same. */
typedef struct bd_motion {
  int pulley, kind;
  size_t n_t;
  const double *t, *values; /* [s], [rad/s]; copied */
  bd_harmonics harmonics;   /* amplitudes [rad]; copied */
  double fade[2];           /* [s] */
  bd_motion_call call;
  void *user;
} bd_motion;

/* All that drives the pulleys. */
typedef struct bd_torque {
  size_t n_terms;
  const bd_torque_term *terms;
  size_t n_breakpoints; /* more times at which to stop exactly (piecewise times are known) */
  const double *breakpoints;
  size_t n_motions;
  const bd_motion *motions; /* torque terms have no say in the pulleys that these move */
  /* Looked at after every call of a FUNCTION: not 0 stops the run (BD_ERR_CALLBACK), for functions
   * that cannot say so themselves, and for other threads. May be NULL; must outlive the
   * simulation. */
  const volatile int *stop;
} bd_torque;

/* --- simulation ------------------------------------------------------------------------------ */

typedef struct bd_options {
  const char *method; /* one of bd_method_name, or NULL: "auto" */
  double rtol;        /* adaptive: error asked for, of the joint forces over the mean tension; what
                       * local errors it allows stands with the method (bd_method.error_target) */
  double step;     /* rk4: the step (0: from all that is stiff, stiffness.c); lbdf2, lie: the step
                    * (0: they are adaptive); the others: the first step (0: chosen) */
  double max_step; /* 0: none */
  long max_steps;  /* 0: none, but a run without progress ends in BD_ERR_STALLED */
  double torque_interval; /* torque functions are called at least this often [s]; those that jump
                           * all the time are followed in steps of a twenty-fifth of it */
  int ledger;             /* carry the energy ledger */
  int guards; /* 0: without what guards.c and growth.c watch, to measure what that costs */
} bd_options;

void bd_options_default(bd_options *options);
/* Names of the methods, "auto" first; NULL past the last. */
const char *bd_method_name(size_t k);

typedef struct bd_sim bd_sim;

/* Ready to run from `initial` to t_end under `torque`. A state with a joint stretched by more than
 * a link, that does not run round every pulley, or in which a pulley has not the speed with which
 * its prescribed motion begins, is BD_ERR_STATE. */
int bd_sim_create(bd_sim **out, const bd_model *model, const bd_state *initial,
                  const bd_torque *torque, double t_end, const bd_options *options, bd_error *err);

typedef struct bd_settle_options {
  int friction;     /* friction acts while settling (and its state is kept) */
  int free_pulleys; /* pulleys may turn; else they are held */
  const double
      *offset;      /* (n_p, 2): centres start displaced by this and move in; NULL: they do not */
  double move_time; /* duration of that motion [s]; 0: chosen */
  double shift;     /* link 0 is laid this far past its place along the belt line [m] */
  double tolerance; /* at rest when the unbalanced force is below this times the mean tension */
  double max_time;  /* give up after this much simulated time [s]; 0: chosen */
  double speed;     /* of the belt along itself in its spans, > 0 in the order of its links: it runs
                     * steadily without load, friction is off; 0: at rest [m/s] */
} bd_settle_options;

void bd_settle_options_default(bd_settle_options *options);

typedef struct bd_settling bd_settling;

/* Brings the belt to rest under preload, from the belt line (or `initial`). */
int bd_settle_create(bd_settling **out, const bd_model *model, const bd_state *initial,
                     const bd_settle_options *options, bd_error *err);
/* As bd_sim_advance; BD_OK: at rest. */
int bd_settle_advance(bd_settling *settling, long max_steps, bd_error *err);
/* The simulation that it runs, to be looked at: bd_sim_state has zero velocities once at rest. */
bd_sim *bd_settle_sim(bd_settling *settling);
void bd_settle_free(bd_settling *settling);

void bd_sim_free(bd_sim *sim);

/* Where samples go: row k of each array (row length as BD_OUTPUTS; of PLANE 2 n_p numbers, x and y
 * of pulley 0, of pulley 1, ...) at time t[k]; NULL arrays are neither computed nor written.
 * `pulley` (int32): the touched pulley or -1. `span_tension` (n_p): as bd_span_tension. `across`
 * (1): squares of the velocities across themselves of links that touch nothing, their sum over the
 * number of all links [m^2/s^2]; of a run at some 500 samples, the others stay as they are. t:
 * non-decreasing, within the run. The times are copied, the arrays stay the caller's and must
 * outlive the run. */
typedef struct bd_output {
#define X(name, group, size, unit, text) double *name;
  BD_OUTPUTS(X)
#undef X
  int32_t *pulley;
  double *span_tension;
  double *across;
} bd_output;

/* Mean force of the joints of the free span that follows each pulley (np); of one that has no free
 * joint, NaN. touched, force: of a sample, pulley and force of n links. Only joints between two
 * links that touch nothing count, and not where links have lifted off within a wrap; of a span with
 * a single such link the joint before it. */
void bd_span_tension(int n, const int32_t *touched, const double *force, int np, double *tension);

enum {
#define X(name, kind, text) BD_ENERGY_##name,
  BD_ENERGY_TERMS(X)
#undef X
      BD_N_ENERGY
};

/* The columns of the output `energy` in runs of a model, as BD_ENERGY_...; how many, and so the
 * length of its rows. Those up to BD_ENERGY_residual are always there, in their order. terms:
 * BD_N_ENERGY, or NULL. */
int bd_model_energy_terms(const bd_model *model, int *terms);
int bd_sim_set_output(bd_sim *sim, size_t n, const double *t, const bd_output *output,
                      bd_error *err);

/* At most max_steps steps: BD_MORE if there is more to do, BD_OK at the end. After an error the
 * state is that of the last good step, and every finished sample stands. Calling it again repeats
 * the error. A second call while one runs (another thread, a torque function): BD_ERR_BUSY. */
int bd_sim_advance(bd_sim *sim, long max_steps, bd_error *err);

double bd_sim_time(const bd_sim *sim);
size_t bd_sim_samples(const bd_sim *sim); /* finished rows */
int bd_sim_state(const bd_sim *sim, bd_state *out);

/* The restart record: with it a simulation made of the same model, torques, t_end and options, in
 * another process too, goes on as this one would have, bit for bit; a state alone does not know the
 * step, the history and what was last evaluated. Returns its size; record NULL: only
 * that; 0 after an error, which may have come in the middle of a step (but for max_steps, which the
 * simulation that goes on may have more of). Not while the simulation runs. */
size_t bd_sim_export(const bd_sim *sim, void *record);
/* Into a simulation that has not begun, whatever its initial state; its sample times are set
 * before, and those up to the time of the record are left out. Refuses by name what is no record,
 * is damaged, or belongs to another run or other kernels, and then changes nothing. */
int bd_sim_import(bd_sim *sim, const void *record, size_t size, bd_error *err);

typedef struct bd_stats {
#define X(type, name, text) type name;
  BD_STATS(X)
#undef X
} bd_stats;

void bd_sim_stats(const bd_sim *sim, bd_stats *out);
/* The method in use ("auto" may change it), and, in a sentence, why. */
const char *bd_sim_method(const bd_sim *sim);
void bd_sim_explain(const bd_sim *sim, char *text, size_t size);
/* What was noticed so far, each code at most once, in the order of the table; 0 past the last. */
int bd_sim_warning(const bd_sim *sim, size_t k, bd_warning *out);
/* Names of the passes of the plan, in order; NULL past the last. */
const char *bd_sim_pass(const bd_sim *sim, int k);
/* The table of effects: the name of a row, NULL past the last, and what in a scene calls for it:
 * groups of BD_PARAMETERS, or gravity, motion, torque, friction, with spaces between them; empty:
 * settling alone has it. The row of a pass of the plan; -1: it is none of an effect. */
const char *bd_effect_name(int row);
const char *bd_effect_asked_by(int row);
int bd_sim_effect(const bd_sim *sim, int k);

/* How large a simulation is: numbers of the state vector, padding included, and of the works in it;
 * bytes of the simulation's blocks without its samples, the one that runs beside it included. */
typedef struct bd_sizes {
  size_t state, works, bytes;
} bd_sizes;

void bd_sim_sizes(const bd_sim *sim, bd_sizes *out);

/* A pass of a step of the method in use: how often a step calls it, and what a call takes [s]. */
typedef struct bd_pass_time {
  const char *name; /* lives as long as the simulation */
  double calls, seconds;
} bd_pass_time;

enum { BD_MAX_PASSES = 32 };

/* Measures at the state now reached, in so many rounds over all passes, of which medians are taken,
 * each of about 0.1 ms a pass; torque functions are called. In the order in which a step has them,
 * last the whole step, of which the passes are the parts. Ends the run, which must have made a
 * step. */
int bd_sim_time_passes(bd_sim *sim, int rounds, bd_pass_time out[BD_MAX_PASSES], int *n,
                       bd_error *err);

/* Time derivative of a state under the model (torque as given), laid out as a bd_state; for tests
 * and for other integrators. torque: one value per pulley. Angles of a string follow from its
 * places: 0. */
int bd_model_rate(const bd_model *model, const bd_state *state, const double *torque,
                  bd_state *rate, bd_error *err);

/* The torques set at a time (n_p), by angles and speeds of the pulleys. Of motions the speeds at
 * that time are put into omega first: they are smooth from there up to `until`. */
int bd_model_torques(const bd_model *model, const bd_torque *given, double t, double until,
                     const double *theta, double *omega, double *torque, bd_error *err);

/* The outputs of a state without torques: one row into the arrays that are not NULL. Energies are
 * those stored; works are 0. */
int bd_model_observe(const bd_model *model, const bd_state *state, const bd_output *output,
                     bd_error *err);

/* The state with its belt running along itself, at the speed v in its spans, > 0 in the order of
 * the links, and all pulleys turning with it. Positions, angles and friction are those of the
 * state, which settling at that speed makes those of a belt that runs steadily. */
int bd_model_set_going(const bd_model *model, const bd_state *state, double speed, bd_state *going,
                       bd_error *err);

/* The same state's Jacobian J, by what it solves: (1 - g J) k = g c, c and k laid out as a bd_state
 * (times are not looked at). The torque is constant. g > 0 [s]. Contact and friction are taken on
 * the side of their kinks on which the state stands. */
int bd_model_solve(const bd_model *model, const bd_state *state, double g, const bd_state *c,
                   bd_state *k, bd_error *err);

/* J itself, d(rate)/d(state): entries that are not 0, each once, in no order, of the `size` numbers
 * that the arrays of a bd_state hold, one after the other in the order of BD_STATE_FIELDS; phi and
 * vphi of a string, which are no unknowns, have none. One block, to be freed by bd_jacobian_free.
 */
typedef struct bd_jacobian {
  size_t size, n;
  int64_t *rows, *columns;
  double *values;
} bd_jacobian;

int bd_model_jacobian(const bd_model *model, const bd_state *state, bd_jacobian **out,
                      bd_error *err);
void bd_jacobian_free(bd_jacobian *jacobian);

/* What a mount is called, by BD_MOUNT_..., NULL: there is none; and the pair that says along what
 * it moves, NULL: times and displacements do. */
const char *bd_mount_name(int kind, const char **guide);
/* How the axis moves with the travel of a mount that has such a pair, from `center` on: [m] of an
 * angle, its lever; 1 of a length. */
void bd_mount_direction(const bd_mount *mount, const double center[2], double direction[2]);
/* Weight of a kilogram hung on a slider [N]. */
#define BD_GRAVITY 9.80665
const char *bd_law_name(int law);
int bd_law_find(const char *name); /* -1: there is none */
/* The law of a pulley, its coefficient in full slip, and the slip in which friction is fully
 * developed at rest under preload [m], 0 of a law without a state; without friction 0 and infinite.
 */
int bd_model_friction(const bd_model *model, int pulley, double *kinetic, double *slip);

/* `label` is what messages call it. A law that is none has no parameters. */
int bd_friction_check(const bd_friction *friction, const char *label, bd_error *err);

/* How many states a law has, of a link; 0: it is a function of slip velocity and normal force. */
int bd_friction_states(const bd_friction *friction);

/* Of an element of a law (0 of most) at one link in contact, its state z, slip velocity v [m/s] and
 * normal force [N]: the force against slip, the rate of the state, and how both change with N, z
 * and v. */
typedef struct bd_law_point {
  double force, rate;
  double by_normal, by_state, by_slip;
  double rate_by_normal, rate_by_state, rate_by_slip;
} bd_law_point;

/* l0: stress-free length of a link [m]. Checks the parameters; neither model nor belt is needed. */
int bd_friction_evaluate(const bd_friction *friction, double l0, int element, double z, double v,
                         double normal, bd_law_point *out, bd_error *err);

/* --- build ----------------------------------------------------------------------------------- */

/* Kernel level a model made now would use ("avx512", "avx2", "baseline"): the processor's best, or
 * what the environment variable BELTDYN_KERNELS names; "none" if the processor lacks that one, and
 * then no model can be made. */
const char *bd_kernel_level(void);

#ifdef __cplusplus
}
#endif
#endif
