/* SPDX-License-Identifier: MIT
 *
 * The model: parameters and what follows from them, the belt line round the pulleys, and states
 * between the caller's arrays and the flat vector.
 */
#ifndef BELTDYN_MODEL_H
#define BELTDYN_MODEL_H

#include <math.h>

#include "kernels/kernels.h"

/* Of a pulley; empty: none. */
typedef struct bd_name {
  char text[BD_MAX_NAME + 1];
} bd_name;

/* The belt line of a drive: what it lies on, and what follows. */
typedef struct bd_route {
  int np;
  const double *cx, *cy, *radius;
  const int *side;     /* +1: inside the loop, -1: outside */
  const bd_name *name; /* NULL: none has any */
  bd_wrap *wraps;
  int direction; /* of turning on pulleys inside: +1 counter-clockwise, -1 clockwise */
  int turns;     /* all in all: the direction, or 0 of a crossed belt */
  double length;
} bd_route;

typedef struct bd_belt_model bd_belt_model;
typedef struct bd_ale_drive bd_ale_drive; /* belts/ale.h */

/* A mount with all its numbers, places relative to the origin (MODEL section 5). A hung weight is
 * in inertia and preload; of one that is prescribed only t, points and slopes are not 0. */
typedef struct bd_mounted {
  int pulley, kind; /* BD_MOUNT_... */
  double drawn[2];  /* place of the axis in the scene */
  double guide[2];  /* pivot; unit vector of its direction */
  double inertia, mass;
#define X(group, name, rule, unit, text) double name;
  BD_SPRUNG(X, sprung, , , , , )
#undef X
  double adapts; /* kappa / F_m, 0 without friction */
  int has_stops;
  const struct bd_mount_kind *row;
  double turning; /* angle by which it turns the bearings of its pulley, over the travel */
  size_t n_t;
  const double *t, *points; /* (n_t), (n_t, 2) */
  double *slopes, *scratch; /* (n_t, 2), (n_t) */
  double fastest;           /* of the axis on it, a bound */
  double rest;              /* travel in equilibrium with the belt */
  double lever, held; /* there: |da/dq|, and the stiffness with which belt and spring hold it */
} bd_mounted;

/* Where a mount has its axis: c(q), a = dc/dq, da/dq. */
typedef struct bd_place {
  double c[2], a[2], bend[2];
} bd_place;

/* A row of the table in mount.c: another mount is another row, and the functions it names. */
typedef struct bd_mount_kind {
  const char *name;  /* and the group of its parameters */
  const char *many;  /* in result.effects */
  const char *guide; /* the pair that says along what it moves; NULL: times and displacements */
  int moves;         /* by what acts on it; 0: it is prescribed, its travel is the time [s] */
  int angle;         /* its travel is one [rad]; 0: a length [m] */
  /* Travel looked at for balance, of a length over the belt's: by steps that grow. */
  double step, longest, farthest;
  /* What the rules of its parameters do not say. */
  int (*check)(const bd_pulley *pulley, int j, bd_error *err);
  /* What its numbers do not say, and those that mean something else. */
  void (*fill)(bd_mounted *mount, const bd_model *model, const bd_mount *given);
  bd_place (*place)(const bd_mounted *mount, double q);
} bd_mount_kind;

/* A row of the table in coupling.c. */
typedef struct bd_coupling_kind {
  const char *name;  /* and the group of its parameters */
  const char *label; /* in result.effects, where there are no others */
  int carries;       /* the belt runs on its rim; 0: on the shaft, and the rim is a free ring */
  int one_way;       /* it never holds the shaft back, and a number that is 0 is chosen */
} bd_coupling_kind;

/* A coupling with all its numbers. Its rim is the part on which no torque acts: of a damper the
 * ring. */
typedef struct bd_coupled {
  const bd_coupling_kind *row;
  int pulley;
  double sense;   /* in which one that is one-way drives the shaft, else 1 */
  double inertia; /* of the rim */
  double stiffness, damping;
} bd_coupled;

struct bd_model {
  bd_info info;
  uint64_t given; /* check sum of the scene */
  bd_belt belt;
  bd_contact contact;
  int has_friction, has_bending, has_gravity;
  const bd_belt_model *belt_model; /* its row of the table in belts/ */
  int friction_scales_differ;      /* of the laws' states (bd_friction_state_scale), from pulley to
                                      pulley */
  double gravity[2], origin[2];
  bd_layout lay;
  double *cx, *cy, *radius; /* centres relative to the origin */
  double *inertia;          /* of the shafts: what torques act on */
  double *rim_inertia;      /* of what the belt runs on: the same, unless there is a coupling */
  double *contact_radius;   /* on which the links' ends (centres) of an unloaded belt run */
  bd_drag *drag;            /* by pulley; NULL: none has any */
  bd_friction *friction;    /* by pulley */
  int *slot; /* colour of each pulley, its friction slot: of one colour, none can share a link;
              * BD_EVERY_SLOT: a cell of its has all of them */
  int colours;
  int *side;    /* +1: inside the loop, -1: outside */
  int *winding; /* turns of the belt round the axis of each */
  bd_name *name;
  bd_wrap *wraps;
  double longest_span;
  bd_error geometry;     /* what bd_model_check_geometry returns */
  double far_away;       /* where the padding stands: on no pulley */
  bd_mounted *mounts;    /* lay.nm; NULL: none */
  int n_moving;          /* of them those that move by what acts on them */
  char moving[64];       /* what result.effects calls these */
  int *mounted;          /* their pulleys */
  int *mount_of;         /* by pulley its mount, -1: none; NULL: there are no mounts */
  bd_coupled *couplings; /* lay.nc; NULL: none */
  int *coupled, *rim;    /* of the layout */
  bd_ale_drive *drive;   /* of an ALE belt; NULL: it is none */
  const bd_kernels *kernels;
};

enum { BD_EVERY_SLOT = -1 };

static inline int bd_in_slot(const bd_model *model, int j, int slot) {
  return model->slot[j] == slot || model->slot[j] == BD_EVERY_SLOT;
}

/* --- belts/ ----------------------------------------------------------------------------------- */

typedef struct bd_plan bd_plan; /* physics/physics.h */
typedef struct bd_newton_belt bd_newton_belt;

/* A joint as outputs see it: stretch along the belt there, square of the whole stretch; the angle
 * between its nodes; the force in it. */
typedef struct bd_joint {
  double along, squared, turn, force;
} bd_joint;

/* The contact at a node, or at the joint on its left, as outputs see it: where friction acts; the
 * share of the belt there that touches, 0: none; the normal force under which, the least of its
 * parts, and what of it acts there too. */
typedef struct bd_touch {
  double x, y, vx, vy, share, normal, least, acts;
} bd_touch;

/* Of the contact with a pulley: what its forces on the belt add up to without regard to sign, their
 * least normal force, and by how much rounding may shift their sum. */
typedef struct bd_contact_rounding {
  double magnitude, least_normal, shift;
  int least; /* node */
} bd_contact_rounding;

/* h sum a[j] k[j] of m vectors laid out as states, over what errors are measured by. */
typedef struct bd_step_sum {
  double h;
  int m;
  const double *a;
  double *const *k;
  const double *weights;
} bd_step_sum;

/* A belt model, a row of the table in belts/belts.c: another one is another file there, the kernels
 * that it names, and a row. Functions are of whole belts but for two that steps do not ask, of a
 * state that is read and of samples; what is done for every node in every step is in kernels. */
struct bd_belt_model {
  bd_belt_facts facts;
  const bd_newton_belt *newton; /* its part of linear systems (solvers/solvers.h) */
  const char *joints_text[2];   /* for result.effects, without bending and with */
  /* --- the model's: the way into a run and out of it */
  /* What a model of np pulleys keeps for it; NULL: nothing. */
  void (*carve_drive)(bd_carver *carver, bd_ale_drive **drive, int np);
  /* Once the belt line is laid, or could not be: how many cells there are (lay.n; NULL: n_bodies
   * nodes), and what else follows. Returns the length of the shortest. */
  double (*shape)(bd_model *model);
  /* 1 / scale of the errors of its unknowns that the table of fields does not say. */
  void (*weigh)(const bd_model *model, double *weights);
  /* Least distance from a point of what touches at node i; NULL: it is not known. */
  double (*distance)(const bd_model *model, const bd_state *state, int i, const double point[2]);
  /* Directions and their rates where they are no fields of the state, continuous along the belt;
   * either may be NULL. Itself NULL: they are fields. */
  void (*directions)(const bd_layout *lay, const double *y, double *phi, double *vphi);
  /* Nodes along the belt line, node 0 `shift` past its place [m]: where settling begins. */
  void (*lay)(const bd_model *model, const bd_route *line, double shift, double *x, double *y,
              double *phi);
  /* bd_model_cells; NULL: the belt is of nodes. */
  void (*cells)(const bd_model *model, int32_t *pulley, double *share);
  /* Velocities of a belt that runs along itself at a speed in its spans. */
  void (*set_going)(const bd_plan *plan, double *y, double speed);
  /* At rest, or running along itself at a speed in its spans; NULL: settling relaxes it. */
  int (*rest)(const bd_plan *plan, double speed, double *y, bd_error *err);
  /* --- physics: the effects "joints" and "contact" */
  void (*carve)(bd_carver *carver, bd_plan *plan, const bd_model *model); /* NULL: no scratch */
  /* The rate of the belt without its contact; returns what its dampers lose. */
  double (*joints)(bd_plan *plan, double *y, double *dy);
  void (*fall)(const bd_plan *plan, double *dy); /* adds gravity to the rate */
  /* Adds contact and friction of pulley j to the rate, or to scratch; before all pulleys and after
   * them (NULL: nothing). */
  void (*contact)(bd_plan *plan, int j, double *y, double *dy, bd_sums *sums);
  void (*contact_begin)(bd_plan *plan, double *y);
  void (*contact_end)(bd_plan *plan, double *dy);
  /* Mounts have its inertia to move as well: from their rates without it to those with it. */
  void (*carry)(const bd_plan *plan, double *dy);
  /* Squared distances from pulley j of nodes [begin, end), after bd_plan_see and bd_plan_near. */
  void (*distances)(const bd_plan *plan, const double *y, int j, int begin, int end, double *out);
  /* All joints at a state; directions of its nodes if they are known, else NULL. */
  void (*joints_at)(const bd_plan *plan, const double *y, const double *co, const double *si,
                    bd_joint *out);
  /* Direction of the belt at node i. */
  void (*direction)(const bd_layout *lay, const double *y, int i, double e[2]);
  /* The contact of pulley j, after bd_plan_see: at the nodes on its list; the normal force on the
   * belt that does not act there; its stored energy, added. */
  void (*contact_at)(const bd_plan *plan, const double *y, int j, bd_touch *out, double force[2],
                     double *energy);
  /* Its stored energy alone, added; whether anything touches. */
  int (*contact_energy)(const bd_plan *plan, const double *y, int j, double *energy);
  /* Before a step of length h from y: what may touch which pulley within it. At the start of a run:
   * what touches which, from positions alone. After a step: bd_effect. */
  void (*list)(bd_plan *plan, const double *y, double h);
  void (*begin)(bd_plan *plan, double *y);
  int (*after_step)(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                    bd_error *err);
  /* A norm of it; NULL: the largest (bd_kernels.error_norm). */
  double (*error)(const bd_plan *plan, const bd_step_sum *of);
  /* What that last did to a state, to one before it; NULL: what friction has been reset. */
  void (*rebase)(const bd_plan *plan, double *y);
  /* Torque of friction on the rim of pulley j, and the force of its contact on the belt, friction
   * included; row k of the outputs of contact. */
  double (*push)(const bd_plan *plan, const double *y, int j, double force[2]);
  void (*contact_outputs)(bd_plan *plan, const double *y, const bd_output *out, size_t k);
  bd_contact_rounding (*rounding)(const bd_plan *plan, const double *y, int j);
  /* By how much friction without a state, all of a pulley's, leaves the line from the begin of a
   * step where it is too steep for an implicit step to see it, over the tension at rest. */
  double (*off_line)(bd_plan *plan, const double *y, const double *y_new, double h);
  /* Adds the energy of the belt, but for contact, to the terms. */
  void (*energy)(const bd_plan *plan, const double *y, const bd_joint *joints,
                 double terms[BD_N_ENERGY]);
  /* Turns of the belt round the axis of pulley j, which stands where the plan has it. */
  int (*turns)(const bd_plan *plan, const double *y, int j);
  /* Sum of squares of what the joints' stretches in two states, of plans of their own whose rates
   * were the last to be evaluated there, are apart. */
  double (*stretch_difference)(const bd_plan *plan, const double *y, const bd_plan *other,
                               const double *v);
};

/* Of a polygon whose links turn by 2 a each: the speed of their centres, as it turns about the axis
 * of its pulley, over that of a straight span. */
static inline double bd_slower_inside(double a) {
  return fabs(a) > 1e-6 ? a / tan(a) : 1.0;
}

/* The row that a belt asks for, NULL: there is none; refuses what no row is. */
const bd_belt_model *bd_belt_model_of(const bd_belt *belt);
int bd_belt_check(const bd_belt *belt, bd_error *err);

/* --- parameters.c ----------------------------------------------------------------------------- */

/* Of a parameter, into at most BD_MAX_ELEMENTS; returns how many, 1 but of a list. */
int bd_parameter_values(const bd_parameter *row, const void *group, double *values);
/* Onto a check sum: of a group; of all that a scene gives but mounts and couplings. */
uint64_t bd_parameters_sum(uint64_t sum, const char *group, const void *record);
uint64_t bd_scene_sum(const bd_scene *scene);
int bd_parameters_list_length(const char *group, const void *record); /* 0: it has no lists */
/* All of a group against their rules; `label` is what messages call it. */
int bd_parameters_check(const char *group, const char *label, const void *record, bd_error *err);

/* --- names.c ---------------------------------------------------------------------------------- */

int bd_names_check(const bd_scene *scene, bd_error *err);
void bd_names_copy(bd_name *names, int np, const bd_pulley *pulleys);
/* Two of them: pulleys 0 and 3, or pulley "crank" and pulley 3. */
bd_label bd_pulleys_label(const bd_model *model, int j, int k);
/* So many links at least, as advice; none where that is more than a belt may have. */
bd_label bd_links_label(double least);

/* --- friction.c ------------------------------------------------------------------------------- */

const char *bd_law_text(int law); /* as in "contact with ... friction" */
int bd_law_is_general(int law);
int bd_friction_most_states(const bd_model *model); /* of all pulleys */
/* Of a link on pulley j, an element of its law with its state; without friction all 0. */
void bd_friction_at(const bd_model *model, int j, int element, double z, double v, double normal,
                    bd_law_point *out);
/* Bound of a state after a step (INFINITY: none; 0 of one that the law does not have); coefficient
 * in full slip. */
double bd_friction_bound(const bd_model *model, int j, int element);
double bd_friction_kinetic(const bd_model *model, int j);
/* Whether friction is above the kinetic on any pulley while slip is slow: a Stribeck curve. */
int bd_friction_falls(const bd_model *model);
/* As seen by a link that sticks under a normal force: stiffness [N/m] and damping [N s/m]; and the
 * rate at which the state of a general law adapts in full slip, at 1 m/s [1/s]. */
typedef struct bd_friction_stiffness {
  double stiffness, damping, adapts;
} bd_friction_stiffness;
bd_friction_stiffness bd_friction_stiffness_of(const bd_model *model, int j, double normal);
/* At rest under preload: the slip in which friction is fully developed [m]; the state that is worth
 * the normal force. Of pulleys with friction. */
double bd_friction_slip(const bd_model *model, int j); /* 0 of a law without a state */
int bd_friction_scales_differ(const bd_model *model);
double bd_least_slip(const bd_model *model); /* of all laws with a state; INFINITY: there is none */
double bd_friction_state_scale(const bd_model *model, int j, int element); /* or INFINITY */

/* Stiffness of a contact c1 p^2 + c2 p under a force: the root of what its depth is found by. */
/* Damping under a normal force, of a link [N s/m]; of a metre of belt with b' and force per metre.
 */
static inline double bd_contact_damping(const bd_model *model, double linear, double force) {
  return linear + model->contact.hunt_crossley * force;
}

static inline double bd_contact_stiffness(double c1, double c2, double force) {
  return sqrt(c2 * c2 + 4.0 * c1 * force);
}

/* --- mount.c ---------------------------------------------------------------------------------- */

int bd_mount_check(const bd_scene *scene, int pulley, bd_error *err);
void bd_model_carve_mounts(bd_carver *carver, bd_model *model, const bd_scene *scene);
void bd_model_fill_mounts(bd_model *model, const bd_scene *scene);
static inline bd_place bd_mount_place(const bd_mounted *mount, double q) {
  return mount->row->place(mount, q);
}
/* On one that moves: of the spring; of the stops, and the power they lose; of gravity. */
double bd_mount_spring(const bd_mounted *mount, double q);
double bd_mount_stop(const bd_mounted *mount, double q, double v, double *loss);
double bd_mount_weight(const bd_model *model, const bd_mounted *mount, const bd_place *at);
double bd_mount_stored(const bd_mounted *mount, double q);
/* The mount that turns the bearings of pulley j, against which its drag acts, -1: none does. */
static inline int bd_turned_by(const bd_model *model, int j) {
  const int m = model->mount_of ? model->mount_of[j] : -1;
  return m >= 0 && model->mounts[m].turning != 0.0 ? m : -1;
}

/* --- coupling.c ------------------------------------------------------------------------------- */

int bd_coupling_check(const bd_scene *scene, int pulley, bd_error *err);
void bd_model_carve_couplings(bd_carver *carver, bd_model *model, const bd_scene *scene);
void bd_model_fill_couplings(bd_model *model, const bd_scene *scene);
/* Where the vector has the speed of what the belt runs on, in the layout. */
void bd_model_place_rims(bd_model *model);
/* A coupling at a state: the speed of its rim before the shaft, the rate of its windup, and the
 * torque, on the shaft, all in its sense; whether it transmits any. */
typedef struct bd_coupling_state {
  double ahead, winds, torque;
  int engaged;
} bd_coupling_state;

bd_coupling_state bd_coupling_at(const bd_model *model, const double *y, int c);
/* Whether the belt runs on the shaft of pulley j itself. */
static inline int bd_runs_on_shaft(const bd_layout *lay, int j) {
  return lay->rim[j] == lay->omega + j;
}

/* --- mount_rest.c ----------------------------------------------------------------------------- */

/* Brings the pulleys on mounts that move to where these are in equilibrium with the tension of the
 * belt: cx, cy of the model, and `rest` of the mounts. Fails, into model->geometry, where there is
 * none. */
int bd_mounts_rest(bd_model *model);
/* Depth of a contact c1 p^2 + c2 p under a force, in the form that is exact for c1 = 0 and c2 = 0.
 */
static inline double bd_contact_depth(double c1, double c2, double force) {
  return 2.0 * force / (c2 + bd_contact_stiffness(c1, c2, force));
}

/* --- rest.c ----------------------------------------------------------------------------------- */

/* Mean tension of the belt between its fixed axes, without load, that runs along itself at a speed
 * [m/s], 0: at rest [N]. */
double bd_rest_tension(const bd_model *model, double speed);
/* The same, about, of a belt with mounts, too. */
double bd_running_tension(const bd_model *model, double speed);
/* By how much the path is shorter at one end of a wrap than if the belt lay on its circle up to
 * there, at this depth under this pull (tension times stretch). */
double bd_shorter_at_end(double pull, double bending, double radius, double depth);
/* Radius on which it runs under a tension at that speed: less by the depth by which it sinks in,
 * more by what a compensated contact begins further out. */
double bd_running_radius(const bd_model *model, int j, double tension, double speed);

/* --- model.c ---------------------------------------------------------------------------------- */

double bd_tightest_radius(const bd_model *model);
/* Length of the tangent by which the belt would go from one pulley to the other if their axes were
 * so far apart, 0: they overlap; and the least at which their contacts are told apart. */
double bd_tangent_length(const bd_model *model, int j, int k, double apart);
double bd_least_span(const bd_model *model, int j, int k);
/* Tension of the belt at rest round the pulleys as they stand in cx, cy, 0 if it is slack; NaN and
 * the reason in `err` if it has no line. Sets wraps. */
double bd_model_tension(bd_model *model, bd_error *err);

/* What a joint's stretch at rest is worth as a speed [m/s]: over the time a wave needs round a belt
 * of 60 links. */
double bd_speed_scale(const bd_model *model);
/* Time that a stretch wave takes once round the belt: the measure of what is long. */
double bd_round_time(const bd_model *model);
/* In which the lowest stretch wave round the belt decays by e: at (eta A / EA) omega^2 / 2. */
double bd_wave_life(const bd_model *model);

/* Lays the belt line from its pulleys and sides on; returns BD_ERR_GEOMETRY with the reason if
 * there is none. */
int bd_belt_line_lay(bd_route *route, bd_error *err);
/* Point and tangent angle at distance s along the line from where the belt leaves pulley 0, lifted
 * off its radii to those of `raised`; the angle runs on continuously. */
void bd_belt_line_point(const bd_route *route, const double *raised, double s, double *x, double *y,
                        double *phi);
/* Turns of the line round the axis of a pulley: those of its direction inside the loop, 0 outside;
 * of a crossed belt those of the loop in which it lies. */
int bd_belt_line_winding(const bd_route *route, int pulley);
int bd_belt_line_overlap(int np, const double *cx, const double *cy, const double *radius, int *i,
                         int *j);
/* Sum of the unit vectors along the two spans, away from the pulley: the force of the belt on it,
 * over the tension. */
void bd_belt_line_pull(const bd_wrap *wrap, double pull[2]);

/* --- state.c --------------------------------------------------------------------------------- */

enum {
  BD_SCALE_NONE,
  BD_SCALE_STRETCH,
  BD_SCALE_TURN,
  BD_SCALE_SPEED,
  BD_SCALE_SPIN,
  BD_SCALE_FRICTION,
  BD_SCALE_GRIP,
  BD_SCALE_WINDUP
};

/* A row of BD_STATE_FIELDS. */
typedef struct bd_field_row {
  const char *name;
  int size, scale;
  size_t member; /* offset of its array in bd_state */
} bd_field_row;

extern const bd_field_row bd_state_fields[BD_N_FIELDS];

/* How many pieces of the state vector a row of the table has, one per slot at most; how long each
 * is, and where piece k begins. */
int bd_field_pieces(const bd_layout *lay, int row);
int bd_field_length(const bd_layout *lay, int row);
size_t bd_field_offset(const bd_layout *lay, int row, int k);
/* Lays out the vector of a layout that knows what there is of everything. */
void bd_layout_fields(bd_layout *lay);
/* The row and the link or pulley (the other -1) of an entry of the vector; -1: padding, work. */
int bd_field_at(const bd_layout *lay, size_t entry, int *body, int *pulley);

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
/* The first link whose angle does not run on from that of the one before, -1: none. Angles close
 * with the winding: a step near a turn is one wrapped away. */
int bd_state_wrapped(const bd_model *model, const double *phi, double *turn);
/* First non-finite entry by name and index; NULL if none. */
const char *bd_state_bad(const bd_layout *lay, const double *y, int *body, int *pulley);
/* What errors of a row of the table are measured by, in slot or on pulley k; INFINITY: they are
 * not. Stretch for positions; over half a link or a radius for angles; and for velocities what a
 * joint's stretch is worth over the time a wave needs round a belt of 60 links, which measured runs
 * found as strict as the stretch itself. A state of friction's error is that of the force it stands
 * for, over the normal force at rest. */
double bd_state_scale(const bd_model *model, int row, int k);

#endif
