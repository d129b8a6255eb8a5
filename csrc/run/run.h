/* SPDX-License-Identifier: MIT
 *
 * Running: the driver, settling, the automatic choice of method, guards, messages.
 */
#ifndef BELTDYN_RUN_H
#define BELTDYN_RUN_H

#include <stdatomic.h>

#include "solvers/solvers.h"

/* --- auto.c ---------------------------------------------------------------------------------- */

enum { AUTO_EXPLICIT, AUTO_IMPLICIT, N_AUTO };

typedef struct bd_auto {
  const bd_method *method[N_AUTO];
  int now;
  double per_second[N_AUTO]; /* cost of a simulated second as last seen [us]; 0: not yet */
  double time[N_AUTO];       /* simulated with each [s] */
  long steps[N_AUTO];
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
/* Goes on with the implicit method for good, where explicit steps get nowhere; 0: it does already.
 */
int bd_auto_leave_explicit(bd_sim *sim);

/* --- driver.c -------------------------------------------------------------------------------- */

/* What the guards remember. */
typedef struct bd_guard {
  double fed, drive, passed; /* energy: fed in by the set torques, their work, what passed */
  double t_look, t_window;   /* time of the last look; at joints and balance, at progress */
  long steps_look, tries_window;
  int rings;       /* links ring on their contact, which steps are too long for */
  long bounces;    /* of mounts on their stops */
  double *touched; /* per pulley: when a link was last seen on it */
} bd_guard;

/* Two simulations in steps that follow what those of the run are too long for (growth.c). */
typedef struct bd_missed {
  bd_sim *pair[2];                /* as the run is, displaced */
  double step;                    /* theirs, at most; 0: nothing is missed */
  long steps;                     /* made by both, in all periods */
  int active;                     /* a period is on */
  double next_begin;              /* of the next period, in lengths of the run */
  double first_distance, t_begin; /* of this one; since when it grows */
  double growth, before;          /* so far; difference at the last look, over the first */
  long next_look;                 /* in steps of one of the pair */
} bd_missed;

/* A second simulation beside the run, for short periods (growth.c). */
typedef struct bd_twin {
  bd_missed missed;
  bd_sim *sim, *still;           /* displaced; not displaced, NULL: the run itself */
  int stiff, friction_falls;     /* friction of either kind */
  int lightly_damped;            /* the belt */
  int whole;                     /* the run is so short that one period is all of it */
  double least, before;          /* differences of this period over the first: least, last */
  int active, grows;             /* a period is on; growth has been seen */
  int chatters, times_chattered; /* links chatter; counts that found so */
  int suspected, last;           /* this period is for one of these; the last has begun */
  int excused;                   /* links chattered over a whole period, and nothing grew */
  double next_begin;             /* of the next period, in rounds of a wave since the start */
  double t_begin, next_look;     /* start of this one; its next comparison */
  double first_distance;
  double warn_at, most;       /* growth to warn of; largest seen */
  long steps, events;         /* made by twins; contacts changed at the last count */
  double t_events, t_chatter; /* time of the last count; since when links chatter */
  uint64_t random;
  double seen_t[2], *seen; /* torques of the run at a step's ends */
  double *theta;           /* pulleys' angles at the last count */
} bd_twin;

struct bd_sim {
  size_t bytes, n_kept; /* of its block; pieces of the restart record */
  bd_kept *kept;
  uint64_t given; /* check sum of the torques */
  bd_stepper stepper;
  bd_auto choice; /* of "auto"; choice.method[0] NULL: the method was named */
  bd_options options;
  bd_guard guard;
  bd_twin twin;
  double t_end;
  size_t next_break, next_sample, n_samples;
  double *t_sample;
  bd_output output;
  int settling; /* no error control and no checks of the run */
  int status;
  atomic_flag running;
  double t0, e0, error_before;
  int started, fallbacks_in_a_row; /* steps left to the first order one after the other */
  bd_stats stats;
};

/* How a run fails at its time, and what is noticed of it: bd_fail_at, bd_warn. */
#define BD_FAIL(sim, code, field, body, pulley, value, ...)                                        \
  bd_fail_at(&(sim)->stepper.report.failure, code, field, (sim)->stepper.t, body, pulley, value,   \
             __VA_ARGS__)
#define BD_WARN(sim, code, t, body, pulley, ...)                                                   \
  bd_warn(&(sim)->stepper.report, code, t, body, pulley, __VA_ARGS__)

/* --- guards.c -------------------------------------------------------------------------------- */

void bd_guard_carve(bd_carver *carver, bd_guard *guard, int np);
/* Fails where the belt does not run round a pulley; where the state cannot be one of this drive. */
int bd_guard_winding(const bd_plan *plan, const double *y, bd_error *err, double t);
int bd_guard_initial(const bd_plan *plan, const double *y, bd_error *err, double t);
void bd_guard_begin(bd_sim *sim);
/* After a step; now: whether or not it is time to look. */
int bd_guard_look(bd_sim *sim, int now);
int bd_guard_progress(bd_sim *sim);
/* What ends a run at any step: joints, winding, invariants. The balance of energy is a bound of all
 * that went before, and of what was found out of torques meanwhile. */
int bd_guard_check(bd_sim *sim);
/* What the balance of energy is measured by: what passed so far [J]; and how much of it may be
 * missing, or have appeared, before the run ends. */
double bd_guard_energy(const bd_sim *sim);
/* Fails: `what` ("... has added") an energy that the integration made. */
int bd_guard_out_of_balance(bd_sim *sim, const char *field, double energy, const char *what);
#define BD_MOST_BALANCE 0.5
/* By which factor local errors add up over a run. */
double bd_guard_adds_up(const bd_sim *sim);

/* --- invariants.c ---------------------------------------------------------------------------- */

/* At the end of a run, and where BD_EVERY_STEP is after every step: BD_OK, BD_ERR_INVARIANT, or
 * BD_ERR_NOT_FINITE of works that overflow. The first is what all other checks take for granted. */
int bd_invariants_numbers(bd_sim *sim);
int bd_invariants_check(bd_sim *sim);
#ifdef BD_CHECK_STEPS
enum { BD_EVERY_STEP = 1 };
#else
enum { BD_EVERY_STEP = 0 };
#endif

/* --- growth.c --------------------------------------------------------------------------------- */

void bd_twin_carve(bd_carver *carver, bd_twin *twin, int np);
int bd_twin_create(bd_sim *sim, const bd_torque *torque);
/* After a step. */
void bd_twin_follow(bd_sim *sim);
/* How many times differences have grown beyond what they do in any drive. */
double bd_growth_factor(const bd_twin *twin);
void bd_twin_free(bd_twin *twin);

/* --- laying.c -------------------------------------------------------------------------------- */

/* The state of a belt that lies along its line round the centres where the plan has them at the
 * start, link 0 `shift` past its place [m]. */
int bd_lay_belt(const bd_plan *plan, double shift, double *y, double *turns, bd_error *err);

/* --- going.c --------------------------------------------------------------------------------- */

/* Velocities of a belt that runs along itself at a speed in its spans, positions as they are, and
 * of the pulleys on which it runs without slip. No joint is stretched but by corners of the
 * polygon. */
void bd_set_going(const bd_plan *plan, double *y, double speed);

/* --- messages.c ------------------------------------------------------------------------------ */

/* Numbers are no longer finite, or links sank into a pulley, in a trial of length h; a step that is
 * as short as steps can be does not meet the tolerance. Both return the error's code. */
int bd_sim_fail_unstable(bd_sim *sim, int code, double h);
int bd_sim_fail_floor(bd_sim *sim, double h);
/* A fixed explicit step erred by so much. */
int bd_sim_fail_fixed(bd_sim *sim, double h, double error);
/* After a step: set torques that have no effect, and those beyond their tables. */
void bd_sim_warn_of_torques(bd_sim *sim);

/* --- create.c, driver.c ---------------------------------------------------------------------- */

/* Refuses times that rounding would blur. */
int bd_sim_check_time(const bd_model *model, const char *name, double t, bd_error *err);
/* Whether the run may begin with the prescribed motions; what they need to know of it. */
int bd_sim_begin_motion(bd_sim *sim, bd_error *err);
/* Goes to t_new, as another simulation has done, in equal steps no longer than a longest one, each
 * made shorter if it errs by more than the tolerance; without samples. */
int bd_sim_replay_step(bd_sim *sim, double t_new, double t_piece, double tolerance, double longest);
/* Goes back to the beginning of the run, from y. */
void bd_sim_restart(bd_sim *sim, const double *y, double turns);
/* Shared by simulating and settling: one block with everything, nothing allocated later. */
bd_sim *bd_sim_new(const bd_model *model, const bd_method *method, const bd_method *other,
                   const bd_torque *torque);
/* bd_sim_create for states that no drive can be in. */
int bd_sim_create_unchecked(bd_sim **out, const bd_model *model, const bd_state *initial,
                            const bd_torque *torque, double t_end, const bd_options *options,
                            bd_error *err);

/* --- circulation.c, equilibrium.c ------------------------------------------------------------ */

typedef struct bd_circulation_place {
  double at, force; /* [shares of a link], [m/s^2] */
  int known;
} bd_circulation_place;

/* Of a belt that settles; it is looked at now and then, with the rate of the stopped belt. */
typedef struct bd_circulation {
  double try_after;          /* the damping after which Newton's method is tried */
  int fine;                  /* whether it may be moved */
  double force, speed, time; /* at the last look; time: of the last move, of a belt that is moved */
  double stiffness;          /* as seen */
  int looks;                 /* since gains were changed */
  double at, step;           /* how far it has been moved; by how much next [shares of a link] */
  bd_circulation_place ends[2]; /* last places with a force ahead, back */
  int last, tries, moves;       /* which of them is the last one; moves between them, and all */
} bd_circulation;

void bd_circulation_begin(bd_circulation *circulation, bd_sim *sim);
void bd_circulation_look(bd_circulation *circulation, bd_sim *sim, const double *dy);
/* After a look; 1: the belt has been put where forces balance. */
int bd_circulation_ends(bd_circulation *circulation, bd_sim *sim, double tolerance);
/* Takes all velocities out of y; returns the largest, of link ends and rims [m/s]. */
double bd_stop(const bd_sim *sim, double *y);
/* The largest unbalanced force in rates of a stopped belt, over the mean tension. */
double bd_unbalanced(const bd_sim *sim, const double *dy);
/* By Newton's method from where the belt is; 0, and the belt is where it was: not within a hundred
 * steps. For simulations with room for the method "lie". */
int bd_find_equilibrium(bd_sim *sim, double tolerance);

#endif
