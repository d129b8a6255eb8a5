/* SPDX-License-Identifier: MIT
 *
 * Messages of failed runs, and warnings.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "run/run.h"

/* A fixed step beyond the stability limit shows as links that sank into a pulley or as numbers that
 * are not finite. */
int bd_sim_fail_unstable(bd_sim *sim, int code, double h) {
  const bd_method *m = sim->now;
  int body = sim->failure.body, pulley = sim->failure.pulley;
  const char *name = "contact";
  if (code == BD_ERR_NOT_FINITE) {
    name = bd_state_bad(&sim->model->lay, sim->y_new, &body, &pulley);
    name = name ? name : "rate";
  }
  char where[32] = "";
  if (body >= 0 || pulley >= 0) {
    snprintf(where, sizeof where, " of %s %d", body >= 0 ? "link" : "pulley",
             body >= 0 ? body : pulley);
  }
  if (sim->watch) {
    return bd_fail_at(&sim->failure, code, name, sim->t, body, pulley, h,
                      "settling blew up after t = %.9g s, first in %s%s: the start is too far from "
                      "rest, or parameters are far out of scale",
                      sim->t, name, where);
  }
  if (!sim->fixed) {
    return bd_fail_at(&sim->failure, code, name, sim->t, body, pulley, h,
                      "no step after t = %.9g s gives finite numbers, first in %s%s: look for "
                      "parameters or torques far out of scale",
                      sim->t, name, where);
  }
  double longest = 0.25 * h;
  if (!m->implicit) {
    longest = fmin(0.5 * h, m->stability / bd_stiffness_of(sim->model, &sim->plan.torques).bound);
  }
  return bd_fail_at(&sim->failure, code, name, sim->t, body, pulley, h,
                    "the step after t = %.9g s blew up, first in %s%s (method %s, step %.3g s): "
                    "take a shorter step than %.3g s or an adaptive method",
                    sim->t, name, where, m->name, h, longest);
}

int bd_sim_fail_floor(bd_sim *sim, double h) {
  int body = -1, pulley = -1;
  const char *name = sim->now->implicit ? "the state" : bd_erk_worst(sim, h, &body, &pulley);
  char where[48] = "", asked[48] = "";
  if (!sim->fixed) {
    snprintf(asked, sizeof asked, " without meeting rtol = %g", sim->options.rtol);
  }
  if (!sim->now->implicit) {
    snprintf(where, sizeof where, "; the largest error is in %s of %s %d", name,
             pulley >= 0 ? "pulley" : "link", pulley >= 0 ? pulley : body);
  }
  return bd_fail_at(
      &sim->failure, BD_ERR_STEP_FLOOR, name, sim->t, body, pulley, h,
      "the step fell to its floor, %.3g s, at t = %.9g s%s%s: %s", h, sim->t, asked, where,
      sim->watch   ? "look for parameters far out of scale"
      : sim->fixed ? "take a shorter step or an adaptive method"
                   : "loosen rtol, or look for a jump in the torque and name its time in "
                     "breakpoints");
}

int bd_sim_fail_fixed(bd_sim *sim, double h, double error) {
  int body, pulley;
  const char *name = bd_erk_worst(sim, h, &body, &pulley);
  return bd_fail_at(
      &sim->failure, BD_ERR_FIXED_STEP, name, sim->t, body, pulley, h,
      "the step of %.3g s after t = %.9g s errs by %.3g times the stretch of a joint, "
      "most in %s of %s %d: take a shorter step than %.3g s or an adaptive method",
      h, sim->t, error, name, pulley >= 0 ? "pulley" : "link", pulley >= 0 ? pulley : body,
      fmin(0.5 * h,
           0.75 * sim->now->stability / bd_stiffness_of(sim->model, &sim->plan.torques).bound));
}

void bd_sim_warn(bd_sim *sim, int code, double t, int body, int pulley, const char *format, ...) {
  bd_warning *w = &sim->warned[code];
  if (w->message[0]) {
    return;
  }
  *w = (bd_warning){.code = code, .t = t, .body = body, .pulley = pulley};
  va_list args;
  va_start(args, format);
  vsnprintf(w->message, sizeof w->message, format, args);
  va_end(args);
}

int bd_sim_warning(const bd_sim *sim, size_t k, bd_warning *out) {
  for (int code = 0; code < BD_N_WARNINGS; ++code) {
    if (sim->warned[code].message[0] && k-- == 0) {
      *out = sim->warned[code];
      return 1;
    }
  }
  return 0;
}
