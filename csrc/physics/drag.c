/* SPDX-License-Identifier: MIT
 *
 * Bearing drag (MODEL section 5): Coulomb, viscous and quadratic. The sign of the speed in the
 * Coulomb term is smooth, s = omega / sqrt(omega^2 + omega_0^2), for a jump would leave a pulley at
 * rest without an equation of motion; omega_0 r is info.drag_speed.
 */
#include <math.h>

#include "physics/physics.h"

double bd_turning_speed(const bd_model *model, int j) {
  return model->info.drag_speed / model->radius[j];
}

bd_resisting bd_coulomb_drag(double size, double omega, double w0) {
  double w2 = omega * omega + w0 * w0;
  return (bd_resisting){.torque = size * (omega / sqrt(w2)),
                        .slope = size * (w0 / w2) * (w0 / sqrt(w2))};
}

bd_resisting bd_resistance(const bd_drag *drag, double omega, double w0) {
  const bd_resisting coulomb = bd_coulomb_drag(drag->coulomb, omega, w0);
  return (bd_resisting){
      .torque = coulomb.torque + (drag->viscous + drag->quadratic * fabs(omega)) * omega,
      .slope = coulomb.slope + drag->viscous + 2.0 * drag->quadratic * fabs(omega)};
}

/* The Coulomb term is steepest at rest. Quadratic drag has no bound of its own; a belt runs at most
 * as fast as transverse waves do on it, sqrt(T / rho A): centrifugal force then takes all pressure
 * off the pulleys. */
double bd_steepest_resistance(const bd_drag *drag, const bd_model *model, int j, double tension) {
  double fastest = sqrt(tension / model->belt.linear_density) / model->radius[j];
  return drag->coulomb / bd_turning_speed(model, j) + drag->viscous +
         2.0 * drag->quadratic * fastest;
}

/* Of pulley j at a state, against its bearings, which a mount may turn. */
static double drag_speed(const bd_model *model, const double *y, int j) {
  const bd_layout *lay = &model->lay;
  const int m = bd_turned_by(model, j);
  return y[lay->omega + j] - (m >= 0 ? model->mounts[m].turning * y[lay->travel_speed + m] : 0.0);
}

static double on_shaft(const bd_plan *plan, const double *y, int j) {
  const bd_model *model = plan->model;
  const double w0 = bd_turning_speed(model, j);
  return -bd_resistance(&model->drag[j], drag_speed(model, y, j), w0).torque;
}

static void add_off_line(bd_resisting *sum, bd_resisting here, bd_resisting there, double faster) {
  sum->torque += there.torque - here.torque - here.slope * faster;
  sum->slope += here.slope;
}

static bd_resisting load_at(const bd_plan *plan, const bd_torque_term *term, double factor,
                            const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const bd_load_value load = bd_load_at(&plan->torques, term, y + lay->theta, y + lay->omega);
  return (bd_resisting){.torque = -factor * load.torque, .slope = -factor * load.by_omega};
}

/* How far the torque at y_new is from the line through that at y, and the slope of this line. */
static bd_resisting off_line(const bd_plan *plan, double t, const double *y, const double *y_new,
                             int j) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_torque_set *set = &plan->torques;
  bd_resisting sum = {0.0, 0.0};
  if (model->drag) {
    const double before = drag_speed(model, y, j), after = drag_speed(model, y_new, j);
    const double w0 = bd_turning_speed(model, j);
    add_off_line(&sum, bd_resistance(&model->drag[j], before, w0),
                 bd_resistance(&model->drag[j], after, w0), after - before);
  }
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    if (term->pulley == j && (term->kind == BD_TORQUE_LOAD || term->kind == BD_TORQUE_TABLE)) {
      const double factor = bd_load_factor(term, t, plan->t_piece);
      add_off_line(&sum, load_at(plan, term, factor, y), load_at(plan, term, factor, y_new),
                   y_new[lay->omega + j] - y[lay->omega + j]);
    }
  }
  return sum;
}

/* Where a pulley sticks to its dry friction, g slope >> inertia: the system divides by it whatever
 * the torque at y_new differs from the line through that at y, in the solution and in the estimate,
 * and a pulley that breaks loose creeps on along the line. Of that difference, its effect on the
 * speed as a free pulley has it, by the share that is hidden; on a slope that falls the system may
 * turn its sign. */
double bd_resistance_unseen(const bd_plan *plan, const bd_step *step) {
  const bd_model *model = plan->model;
  double most = 0.0;
  for (int j = 0; step->implicit && j < model->lay.np; ++j) {
    const double weight = step->weights[model->lay.omega + j];
    if (weight > 0.0) {
      const bd_resisting off = off_line(plan, step->t, step->y, step->y_new, j);
      const double stiff = step->g * off.slope / model->inertia[j];
      const double hidden = fabs(stiff) / fmax(1.0, fabs(1.0 + stiff));
      most = fmax(most, weight * step->h * fabs(off.torque) / model->inertia[j] * hidden);
    }
  }
  return most;
}

/* --- the effect ------------------------------------------------------------------------------ */

/* At rest there is none, and settling would only take longer. */
static int enabled(const bd_model *model, const bd_plan_options *options) {
  return !options->settling && model->drag != NULL;
}

static int rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  double loss = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    const double torque = -on_shaft(plan, y, j);
    const int m = bd_turned_by(model, j);
    dy[lay->omega + j] -= torque / model->inertia[j];
    loss += torque * y[lay->omega + j];
    if (m >= 0) {
      const double on_mount = model->mounts[m].turning * torque;
      dy[lay->travel_speed + m] += on_mount / model->mounts[m].inertia;
      loss -= on_mount * y[lay->travel_speed + m];
    }
  }
  dy[lay->work + W_drag_loss] = loss;
  return BD_OK;
}

static void tangent(const bd_plan *plan, const double *y, bd_derivatives *out) {
  const bd_model *model = plan->model;
  for (int j = 0; j < model->lay.np; ++j) {
    out->pulley_damping[j] =
        bd_resistance(&model->drag[j], drag_speed(model, y, j), bd_turning_speed(model, j)).slope;
  }
}

static void carve_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  BD_CARVE(carver, out->pulley_damping, model->lay.np);
}

static void stiffness(bd_stiffening *at) {
  const double drag =
      bd_steepest_resistance(&at->model->drag[at->pulley], at->model, at->pulley, at->tension);
  bd_stiffen(at, BD_STIFF_PULLEY, "a pulley with very large bearing drag", 0.0, drag / at->inertia,
             0.0);
}

const bd_effect bd_effect_drag = {
    .name = "bearing drag",
    .asked_by = "drag",
    .enabled = enabled,
    .rate = rate,
    .tangent = tangent,
    .carve_tangent = carve_tangent,
    .stiffness = stiffness,
    .on_shaft = on_shaft,
    .n_works = 1,
    .works = {BD_LOST_IN(drag_loss, "drag has given", 1)},
};
