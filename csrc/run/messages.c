/* SPDX-License-Identifier: MIT
 *
 * Messages of failed runs, and warnings.
 */
#include <math.h>
#include <stdio.h>

#include "run/run.h"

static bd_label place(const bd_sim *sim, int body, int pulley) {
  const bd_model *model = sim->stepper.model;
  return pulley >= 0 ? bd_pulley_label(model, pulley) : bd_body_label(model, body);
}

/* A fixed step beyond the stability limit shows as links that sank into a pulley or as numbers that
 * are not finite. */
int bd_sim_fail_unstable(bd_sim *sim, int code, double h) {
  const bd_method *m = sim->stepper.now;
  int body = sim->stepper.report.failure.body, pulley = sim->stepper.report.failure.pulley;
  const char *name = "contact";
  if (code == BD_ERR_NOT_FINITE) {
    name = bd_state_bad(&sim->stepper.model->lay, sim->stepper.y_new, &body, &pulley);
    name = name ? name : "rate";
  }
  char where[128] = "";
  if (body >= 0 || pulley >= 0) {
    snprintf(where, sizeof where, " of %s", place(sim, body, body >= 0 ? -1 : pulley).text);
  }
  if (sim->settling) {
    return BD_FAIL(sim, code, name, body, pulley, h,
                   "settling blew up after t = %.9g s, first in %s%s: the start is too far from "
                   "rest, %sor parameters are far out of scale",
                   sim->stepper.t, name, where,
                   code == BD_ERR_PASSED_THROUGH ? "the contact too soft for the tension, " : "");
  }
  if (!sim->stepper.fixed) {
    return BD_FAIL(sim, code, name, body, pulley, h,
                   "no step after t = %.9g s gives finite numbers, first in %s%s: look for "
                   "parameters or torques far out of scale",
                   sim->stepper.t, name, where);
  }
  double longest = 0.25 * h;
  if (!m->implicit) {
    longest =
        fmin(0.5 * h,
             m->stability / bd_stiffness_of(sim->stepper.model, &sim->stepper.plan.torques).bound);
  }
  return BD_FAIL(sim, code, name, body, pulley, h,
                 "the step after t = %.9g s blew up, first in %s%s (method %s, step %.3g s): "
                 "take a shorter step than %.3g s or an adaptive method",
                 sim->stepper.t, name, where, m->name, h, longest);
}

int bd_sim_fail_floor(bd_sim *sim, double h) {
  int body = -1, pulley = -1;
  const char *name =
      sim->stepper.now->implicit ? "the state" : bd_erk_worst(&sim->stepper, h, &body, &pulley);
  char where[160] = "", asked[48] = "";
  if (!sim->stepper.fixed) {
    snprintf(asked, sizeof asked, " without meeting rtol = %g", sim->stepper.rtol);
  }
  if (!sim->stepper.now->implicit) {
    snprintf(where, sizeof where, "; the largest error is in %s of %s", name,
             place(sim, body, pulley).text);
  }
  return BD_FAIL(sim, BD_ERR_STEP_FLOOR, name, body, pulley, h,
                 "the step reached its lower limit, %.3g s, at t = %.9g s%s%s: %s", h,
                 sim->stepper.t, asked, where,
                 sim->settling ? "look for parameters far out of scale"
                 : sim->stepper.fixed
                     ? "take a shorter step or an adaptive method"
                     : "loosen rtol, or look for a jump in the torque and name its time in "
                       "breakpoints");
}

int bd_sim_fail_fixed(bd_sim *sim, double h, double error) {
  int body, pulley;
  const char *name = bd_erk_worst(&sim->stepper, h, &body, &pulley);
  return BD_FAIL(
      sim, BD_ERR_FIXED_STEP, name, body, pulley, h,
      "the step of %.3g s after t = %.9g s has an error of %.3g times the stretch of a joint, "
      "most in %s of %s: take a shorter step than %.3g s or an adaptive method",
      h, sim->stepper.t, error, name, place(sim, body, pulley).text,
      fmin(0.5 * h, 0.75 * sim->stepper.now->stability /
                        bd_stiffness_of(sim->stepper.model, &sim->stepper.plan.torques).bound));
}

int bd_sim_warning(const bd_sim *sim, size_t k, bd_warning *out) {
  for (int code = 0; code < BD_N_WARNINGS; ++code) {
    if (sim->stepper.report.warned[code].message[0] && k-- == 0) {
      *out = sim->stepper.report.warned[code];
      return 1;
    }
  }
  return 0;
}

void bd_sim_warn_of_torques(bd_sim *sim) {
  bd_stepper *stepper = &sim->stepper;
  const bd_motion_set *motion = &stepper->plan.torques.motion;
  const double t = stepper->t, *omega = stepper->y + stepper->model->lay.omega;
  const bd_torque_term *term =
      bd_load_beyond_table(&stepper->plan.torques, t, stepper->plan.t_piece, omega);
  if (motion->ignored > 0) {
    bd_warn(&stepper->report, BD_WARN_torque_ignored, t, -1, motion->ignored - 1,
            "the torque set on %s, %.4g N m by t = %.6g s, has no effect, for the motion of "
            "this pulley is prescribed: set 0, or leave the motion out",
            bd_pulley_label(stepper->model, motion->ignored - 1).text, motion->ignored_torque, t);
  }
  if (term) {
    const double speed = omega[term->pulley];
    const size_t end =
        speed < term->omega[0] && term->kind == BD_TORQUE_CURVE ? 0 : term->n_points - 1;
    bd_warn(&stepper->report, BD_WARN_beyond_table, t, -1, term->pulley,
            "%s turns at %.6g rad/s at t = %.6g s, faster than the table of its torque "
            "reaches, %.6g rad/s: beyond it the torque stays %.4g N m; give the table up to this "
            "speed",
            bd_pulley_label(stepper->model, term->pulley).text, speed, t, term->omega[end],
            term->torque[end]);
  }
}
