/* SPDX-License-Identifier: MIT
 *
 * Running: the driver, settling, the automatic choice of method, guards, messages.
 */
#ifndef BELTDYN_RUN_H
#define BELTDYN_RUN_H

#include <stdatomic.h>

#include "solvers/solvers.h"

/* --- auto.c ------------------------------------------------------------------------------------
 */

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

/* --- driver.c ----------------------------------------------------------------------------------
 */

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
  bd_newton_system newton;
  bd_opaque opaque;
  bd_guard guard;
  bd_twin twin;
  double t, t0, t_end, h, turns, e0, error_before;
  double *y, *y_new, *y_mid;
  double *stage[MAX_VECTORS]; /* stage[0]: the rate at y */
  double *history[MAX_HISTORY],
      history_h[MAX_HISTORY]; /* states before y, and the steps that led from them */
  int n_history;
  double *weights;
  size_t next_break, next_sample, n_samples;
  double *t_sample;
  bd_output output;
  int started, rate_known, jacobian_known, fixed, status;
  int fallbacks_in_a_row;     /* steps left to the first order one after the other */
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

/* --- opaque.c ----------------------------------------------------------------------------------
 */

void bd_opaque_carve(bd_carver *carver, bd_opaque *opaque, int np);
/* The set torques' derivatives to angles and speeds, as far as they can be believed. */
int bd_opaque_derive(bd_sim *sim);
/* The change with time at the start of a step of length h is in linear.slope; puts that over half
 * the step in its place where the two have nothing to do with each other. */
int bd_opaque_by_time(bd_sim *sim, double h);
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

/* --- guards.c ----------------------------------------------------------------------------------
 */

void bd_guard_carve(bd_carver *carver, bd_guard *guard, int np);
/* Fails where the belt does not run round a pulley; where the state cannot be one of this drive. */
int bd_guard_winding(const bd_plan *plan, const double *y, bd_error *err, double t);
int bd_guard_initial(const bd_plan *plan, const double *y, bd_error *err, double t);
void bd_guard_begin(bd_sim *sim);
/* After a step; now: whether or not it is time to look. */
int bd_guard_look(bd_sim *sim, int now);
int bd_guard_progress(bd_sim *sim);

/* --- twin.c ------------------------------------------------------------------------------------
 */

void bd_twin_carve(bd_carver *carver, bd_twin *twin, int np);
int bd_twin_create(bd_sim *sim, const bd_torque *torque);
/* After a step. */
void bd_twin_follow(bd_sim *sim);
/* How many times differences have grown beyond what they do in any drive. */
double bd_twin_magnifies(const bd_twin *twin);
void bd_twin_free(bd_twin *twin);

/* --- messages.c --------------------------------------------------------------------------------
 */

/* Numbers are no longer finite, or links sank into a pulley, in a trial of length h; a step that is
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

/* --- driver.c, for the methods -----------------------------------------------------------------
 */

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
int bd_sim_ensure_rate(bd_sim *sim);

/* Shared by simulating and settling: one block with everything, nothing allocated later. */
bd_sim *bd_sim_new(const bd_model *model, const bd_method *method, const bd_method *other,
                   const bd_torque *torque, int settling);
/* bd_sim_create for states that no drive can be in. */
int bd_sim_anywhere(bd_sim **out, const bd_model *model, const bd_state *initial,
                    const bd_torque *torque, double t_end, const bd_options *options,
                    bd_error *err);
void bd_sim_weights(bd_sim *sim);

#endif
