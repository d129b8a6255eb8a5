/* SPDX-License-Identifier: MIT
 *
 * The row of the ALE belt: a mesh that stands where the pulleys are, through which the belt flows
 * (MODEL section 11). The state vector has its cells one after the other, span 0, arc 1,
 * span 1, ..., arc 0, each with the node where it begins; the kernels have them in slabs of slots
 * (kernels/ale.h), into which a state is copied and out of which its rates are.
 */
#include <float.h>
#include <math.h>
#include <string.h>

#include "belts/belts.h"

/* --- the model's part ------------------------------------------------------------------------- */

static void carve_drive(bd_carver *carver, bd_ale_drive **drive, int np) {
  bd_ale_pulley *pulleys;
  BD_CARVE(carver, *drive, 1);
  BD_CARVE(carver, pulleys, np);
  if (carver->base) {
    **drive = (bd_ale_drive){.np = np, .pulleys = pulleys};
  }
}

/* Belt that resists bending runs off over sqrt(EI/T): two such ends lie on a wrap, and two more in
 * a span, whose modes are those of a string by then. */
static void check_ends(bd_model *model) {
  const double WRAP = 2.0, SPAN = 4.0,
               off = sqrt(model->belt.bending_stiffness / model->drive->rest);
  for (int j = 0; j < model->lay.np && model->geometry.code == BD_OK; ++j) {
    const double on = model->wraps[j].wrap * model->radius[j], free = model->wraps[j].span;
    if (on < WRAP * off || free < SPAN * off) {
      const int wrap = on < WRAP * off;
      bd_fail(&model->geometry, BD_ERR_GEOMETRY, "belt.mesh",
              "belt.mesh \"ale\" needs a %s of %g times the %.3g mm over which bending runs off a "
              "pulley, sqrt(EI/T), but that %s %s is %.3g mm long: take \"joint\"",
              wrap ? "wrap" : "span", wrap ? WRAP : SPAN, 1e3 * off, wrap ? "on" : "behind",
              bd_pulley_label(model, j).text, 1e3 * (wrap ? on : free));
    }
  }
}

/* What a cell is to follow on an arc: its length, and the angle by which friction grows there, that
 * of a pulley of 40 mm at least: 10 on half a turn where there are 30 on one of 120 mm. */
static double counts(const bd_model *model, int j) {
  return model->wraps[j].wrap * fmax(model->radius[j], 0.04);
}

/* Whether waves along spans count: whether belt follows its ends at once depends on (w S / c)^2, w
 * the fastest that a pulley turns to and fro on its two spans with a third of what they weigh, c
 * the speed of these waves. Its frequency is then wrong by a ninetieth of the square of that. */
static int rings_along(const bd_model *model) {
  const double LEAST = 0.2;
  const int np = model->lay.np;
  double most = 0.0;
  for (int j = 0; j < np; ++j) {
    const double in = model->wraps[(j + np - 1) % np].span, out = model->wraps[j].span;
    const double R = model->radius[j], density = model->belt.linear_density;
    const double belt = model->wraps[j].wrap * R + (in + out) / 3.0;
    const double mass = model->rim_inertia[j] / (R * R) + density * belt, longest = fmax(in, out);
    most = fmax(most, density * longest * longest * (1.0 / in + 1.0 / out) / mass);
  }
  return most > LEAST;
}

/* Some n_bodies cells: one of each span, and of an arc, on average, one more than its part, for
 * their number is even. */
static double shape(bd_model *model) {
  bd_ale_drive *drive = model->drive;
  const bd_belt *belt = &model->belt;
  const int np = model->lay.np, laid = model->geometry.code == BD_OK;
  const int on_arcs = belt->n_bodies > 2 * np ? belt->n_bodies - 2 * np : 1;
  double all = 0.0, shortest = belt->length;
  for (int j = 0; j < np; ++j) {
    all += counts(model, j);
  }
  model->lay.n = 0;
  for (int j = 0; j < np; ++j) {
    const double arc = model->wraps[j].wrap * model->radius[j];
    bd_ale_pulley *pulley = &drive->pulleys[j];
    pulley->center[0] = model->cx[j];
    pulley->center[1] = model->cy[j];
    pulley->radius = model->radius[j];
    pulley->raised = model->contact_radius[j] - model->radius[j];
    pulley->damping = bd_contact_damping(model, model->contact.damping,
                                         model->info.mean_tension / model->radius[j]);
    pulley->side = model->side[j];
    pulley->friction = &model->friction[j];
    pulley->cells = bd_ale_cells(laid ? counts(model, j) : 0.0, all / on_arcs);
    shortest = laid ? fmin(shortest, arc / pulley->cells) : belt->length / (7 * np);
    model->lay.n += pulley->cells + 1;
    model->slot[j] = BD_EVERY_SLOT;
  }
  drive->along = laid && rings_along(model);
  model->lay.n_along = drive->along ? np : 0;
  model->lay.modes = BD_ALE_MODES;
  model->lay.n_modes = np * BD_ALE_MODES;
  drive->direction = model->wraps[0].sense * model->side[0];
  drive->linear_density = belt->linear_density;
  drive->axial_stiffness = belt->axial_stiffness;
  drive->axial_damping = belt->axial_damping;
  drive->bending_stiffness = belt->bending_stiffness;
  drive->bending_damping = belt->bending_damping;
  drive->quadratic = model->contact.quadratic;
  drive->linear = model->contact.linear;
  memcpy(drive->gravity, model->gravity, sizeof drive->gravity);
  drive->rest = model->info.mean_tension;
  drive->moving = model->lay.nm > 0;
  model->colours = 2; /* friction slots: both ends of a cell */
  if (laid && np < 2) {
    bd_fail(&model->geometry, BD_ERR_GEOMETRY, "belt.mesh",
            "belt.mesh \"ale\" needs two pulleys at least, for a belt that lies on one all round "
            "has no span: take \"joint\"");
  } else if (laid) {
    check_ends(model);
  }
  return shortest;
}

static void cells(const bd_model *model, int32_t *pulley, double *share) {
  for (int i = 0, c = 0; i < model->lay.np; ++i) {
    const int j = (i + 1) % model->lay.np, n = model->drive->pulleys[j].cells;
    for (int k = -1; k < n; ++k, ++c) {
      pulley[c] = k < 0 ? -1 : j;
      share[c] = k < 0 ? 0.0 : (double)k / n;
    }
  }
}

/* Where cell c of the state vector stands, and where it begins. */
static void place_cells(const bd_ale *ale, int *slot) {
  for (int i = 0, c = 0; i < ale->np; ++i) {
    const bd_ale_arc *from = &ale->arcs[i], *to = &ale->arcs[from->next];
    slot[c++] = from->begin + from->n;
    for (int k = 0; k < to->n; ++k) {
      slot[c++] = to->begin + k;
    }
  }
}

static void carve(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  bd_ale_belt *belt, sizes;
  double *states[3];
  BD_CARVE(carver, belt, 1);
  bd_ale_belt *to = carver->base ? belt : &sizes;
  bd_ale_carve(carver, &to->ale, model->drive);
  for (int k = 0; k < 3; ++k) {
    BD_CARVE(carver, states[k], bd_ale_state_size(model->drive, model->lay.states));
  }
  BD_CARVE(carver, to->slot, model->lay.n);
  BD_CARVE(carver, to->seen, model->lay.work);
  BD_CARVE(carver, to->carried, model->lay.nm * model->lay.nm);
  BD_CARVE(carver, to->inertia, model->lay.nm * model->lay.nm);
  BD_CARVE(carver, to->forces, 2 * model->lay.nm);
  /* W is that of the last step; states follow from how it changes */
  double **const kept[] = {&to->ale.end_a, &to->ale.end_b, &to->ale.deep_a, &to->ale.deep_b,
                           &to->ale.roll,  &to->ale.cut_a, &to->ale.cut_b,  &to->ale.lies};
  for (size_t k = 0; k < sizeof kept / sizeof *kept; ++k) {
    bd_keep(carver,
            (bd_kept){BD_KEPT_BEHIND, kept[k], (size_t)to->ale.slots * sizeof(double), 0, 0});
  }
  if (!carver->base) {
    return;
  }
  plan->ale = belt;
  belt->kernels = model->kernels->ale;
  bd_ale_make(&belt->ale, model->drive);
  belt->kernels->place(&belt->ale);
  bd_ale_damp_spans(&belt->ale);
  for (int m = 0; m < model->lay.nm; ++m) {
    belt->ale.arcs[model->lay.mounted[m]].mounted = 1;
  }
  place_cells(&belt->ale, belt->slot);
  belt->y = bd_ale_state_in(&belt->ale, model->lay.states, states[0]);
  belt->dy = bd_ale_state_in(&belt->ale, model->lay.states, states[1]);
  belt->spare = bd_ale_state_in(&belt->ale, model->lay.states, states[2]);
}

/* --- states in and out ------------------------------------------------------------------------ */

/* A field of a state vector and its slabs: an arc and the span behind it stand together in both,
 * but for the first span, which begins the vector. */
static void copy_field(const bd_ale *ale, double *restrict y, double *restrict slab, int into) {
  const bd_ale_arc *first = &ale->arcs[0];
  const int span = first->begin + first->n;
  if (into) {
    slab[span] = y[0];
  } else {
    y[0] = slab[span];
  }
  ++y;
  for (int i = 1; i <= ale->np; ++i) {
    const bd_ale_arc *arc = &ale->arcs[i < ale->np ? i : 0];
    double *restrict const cells = slab + arc->begin;
    const int n = arc->n + (i < ale->np);
    for (int k = 0; into && k < n; ++k) {
      cells[k] = y[k];
    }
    for (int k = 0; !into && k < n; ++k) {
      y[k] = cells[k];
    }
    y += n;
  }
}

/* Goes through a state vector and a state in slabs. */
static void copy(const bd_plan *plan, double *y, const bd_ale_state *slabs, int into) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale *ale = &plan->ale->ale;
  const int states = lay->slots > 0 ? lay->states : 0;
  const size_t modes = (size_t)lay->n_modes * sizeof *y, along = (size_t)lay->n_along * sizeof *y;
  copy_field(ale, bd_field(lay, y, F_M), slabs->m, into);
  copy_field(ale, bd_field(lay, y, F_V), slabs->v, into);
  for (int k = 0; k < lay->slots * states; ++k) {
    copy_field(ale, bd_field(lay, y, F_MU + k), slabs->z[k / states] + k % states * slabs->stride,
               into);
  }
  memcpy(into ? slabs->a : y + lay->a, into ? y + lay->a : slabs->a, modes);
  memcpy(into ? slabs->p : y + lay->p, into ? y + lay->p : slabs->p, modes);
  memcpy(into ? slabs->along : y + lay->along, into ? y + lay->along : slabs->along, along);
  memcpy(into ? slabs->along_speed : y + lay->along_speed,
         into ? y + lay->along_speed : slabs->along_speed, along);
}

void bd_ale_read(const bd_plan *plan, const double *y, const bd_ale_state *slabs) {
  copy(plan, (double *)y, slabs, 1);
}

void bd_ale_write(const bd_plan *plan, const bd_ale_state *slabs, double *y) {
  copy(plan, y, slabs, 0);
}

/* --- a rate ----------------------------------------------------------------------------------- */

/* Axes where the plan has them, speeds of rims, laws of friction that the plan has. */
void bd_ale_put_axes(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  for (int j = 0; j < lay->np; ++j) {
    bd_ale_arc *arc = &plan->ale->ale.arcs[j];
    arc->axis.omega = y[lay->rim[j]];
    arc->friction.law = plan->contact_pulleys[j].law;
  }
  for (int m = 0; m < lay->nm; ++m) {
    bd_ale_axis *axis = &plan->ale->ale.arcs[lay->mounted[m]].axis;
    const bd_place at = bd_mount_place(&plan->model->mounts[m], y[lay->travel + m]);
    axis->speed = y[lay->travel_speed + m];
    for (int x = 0; x < 2; ++x) {
      axis->c[x] = at.c[x];
      axis->v[x] = axis->speed * at.a[x];
      axis->lever[x] = at.a[x];
      axis->bend[x] = at.bend[x];
      axis->known[x] = axis->speed * axis->speed * at.bend[x];
    }
  }
}

void bd_ale_evaluate(const bd_plan *plan, const double *y) {
  bd_ale_belt *belt = plan->ale;
  const size_t size = (size_t)plan->model->lay.work * sizeof *y;
  const int asked = belt->ale.everywhere ? 2 : 1;
  if (belt->known < asked || memcmp(belt->seen, y, size) != 0) {
    bd_ale_put_axes(plan, y);
    bd_ale_read(plan, y, &belt->y);
    bd_ale_rate(&belt->ale, belt->kernels, &belt->y, &belt->dy);
    memcpy(belt->seen, y, size);
    belt->known = asked;
  }
}

/* The same, with forces on axes that stand. */
const bd_ale *bd_ale_look(const bd_plan *plan, const double *y) {
  bd_ale *ale = &plan->ale->ale;
  ale->everywhere = 1;
  bd_ale_evaluate(plan, y);
  ale->everywhere = 0;
  return ale;
}

static double joints(bd_plan *plan, double *y, double *dy) {
  (void)plan, (void)y, (void)dy;
  return 0.0; /* known once axes and speeds of rims are (contact_end) */
}

static void fall(const bd_plan *plan, double *dy) {
  (void)plan, (void)dy;
}

static void contact_begin(bd_plan *plan, double *y) {
  bd_ale_evaluate(plan, y);
  if (!plan->skip_power) {
    bd_ale_lose_in_contact(&plan->ale->ale, &plan->ale->y);
  }
}

static void contact(bd_plan *plan, int j, double *y, double *dy, bd_sums *sums) {
  const bd_ale_arc *arc = &plan->ale->ale.arcs[j];
  (void)y, (void)dy;
  *sums = (bd_sums){.torque = arc->torque,
                    .contact_loss = arc->contact_loss,
                    .friction_loss = arc->slip_loss,
                    .force = {-arc->force[0], -arc->force[1]}};
}

static void contact_end(bd_plan *plan, double *dy) {
  const bd_ale_belt *belt = plan->ale;
  bd_ale_write(plan, &belt->dy, dy);
  if (!plan->skip_power) {
    const bd_ale_losses lost = bd_ale_losses_of(&belt->ale, &belt->y);
    dy[plan->model->lay.work + W_joint_loss] = lost.axial + lost.bending;
  }
}

/* Inertia of mounts with that of the belt, which two at the ends of one span share. */
void bd_ale_carried(const bd_plan *plan, double *matrix) {
  const bd_model *model = plan->model;
  const int nm = model->lay.nm;
  const bd_ale *ale = &plan->ale->ale;
  memset(matrix, 0, (size_t)(nm * nm) * sizeof *matrix);
  for (int m = 0; m < nm; ++m) {
    matrix[m * nm + m] = ale->arcs[model->lay.mounted[m]].inertia;
  }
  for (int i = 0; i < ale->np; ++i) {
    const int m = model->mount_of[i], k = model->mount_of[ale->arcs[i].next];
    if (m >= 0 && k >= 0) {
      matrix[m * nm + k] += ale->spans[i].coupling;
      matrix[k * nm + m] += ale->spans[i].coupling;
    }
  }
}

void bd_ale_carry(const bd_plan *plan, const double *inertia, double *q) {
  const int nm = plan->model->lay.nm;
  double *a = plan->ale->carried;
  for (int m = 0; m < nm; ++m) {
    const int moves = plan->model->mounts[m].row->moves;
    for (int k = 0; k < nm; ++k) { /* of those that are prescribed all is known */
      const int both = moves && plan->model->mounts[k].row->moves;
      a[m * nm + k] = both ? inertia[m * nm + k] : 0.0;
    }
    a[m * nm + m] += moves ? plan->mount_inertia[m] : 1.0;
  }
  bd_ale_solve_mounts(nm, a, q);
}

static void carry(const bd_plan *plan, double *dy) {
  double *q = dy + plan->model->lay.travel_speed;
  for (int m = 0; m < plan->model->lay.nm; ++m) {
    q[m] *= plan->mount_inertia[m];
  }
  bd_ale_carried(plan, plan->ale->inertia);
  bd_ale_carry(plan, plan->ale->inertia, q);
}

/* --- between steps ---------------------------------------------------------------------------- */

/* The ends of wraps and waves, by H as it is now. */
static void renew(bd_ale_belt *belt, const bd_ale_state *y) {
  belt->kernels->freeze(&belt->ale, y);
  for (int i = 0; i < belt->ale.np; ++i) {
    bd_ale_hold_waves(&belt->ale, &belt->ale.spans[i], belt->ale.spans[i].pressing);
  }
}

/* W of a state that no step has led to. */
static void list(bd_plan *plan, const double *y, double h) {
  static const int TURNS = 6; /* H goes with what waves are by 1e-3 */
  plan->ale->ale.elapsed = h;
  if (isinf(plan->search.travelled)) {
    bd_mounts_put(plan, y);
    for (int turn = 0; turn < TURNS; ++turn) {
      bd_ale_evaluate(plan, y);
      renew(plan->ale, NULL);
      plan->ale->known = 0;
    }
    plan->search.travelled = 0.0;
  }
}

/* Which pulley a cell's states are of; those that its law does not have are 0. */
static void begin(bd_plan *plan, double *y) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale *ale = &plan->ale->ale;
  for (int i = 0, c = 0; i < lay->np; ++i) {
    const int j = ale->arcs[i].next, last = c + ale->arcs[j].n;
    for (int first = c; c <= last; ++c) {
      const int owner = c == first || plan->contact_pulleys[j].law == BD_LAW_NONE ? -1 : j;
      for (int end = 0; end < lay->slots; ++end) {
        plan->owner[end * lay->n8 + c] = owner;
        for (int e = owner < 0 ? 0 : plan->contact_pulleys[j].states; e < lay->states; ++e) {
          bd_field(lay, y, bd_f_state(lay, end) + e)[c] = 0.0;
        }
      }
    }
  }
}

/* What the model does not hold beyond: belt off a pulley, spans that hang or swing far, waves that
 * the belt outruns. */
static int check_limits(const bd_plan *plan, double t, bd_error *err) {
  const double LEAST = 0.05, STEEPEST = 0.2; /* of the force at rest, or rad; slope of a span */
  const double LATEST = 1.0; /* of bending behind its damper, over what belt needs for it */
  const bd_ale *ale = &plan->ale->ale;
  const char *advice = "which mesh=\"ale\" does not describe: take mesh=\"joint\"";
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const bd_ale_span *span = &ale->spans[j];
    double least = (double)INFINITY, swings = 0.0, stands = 0.0;
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      least = bd_at_most(ale->pressing[k], least);
    }
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      swings += fabs(span->wave[n] * (span->ab[n] - span->rest[n]));
      stands += fabs(span->wave[n] * span->rest[n]);
    }
    const double thrown = ale->density * span->past * span->past / span->stretch;
    if (!(thrown < span->elastic)) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "belt", t, -1, j, thrown,
                        "the belt runs faster than waves in the span behind %s at t = %.9g s, so "
                        "that it lifts off, %s",
                        bd_pulley_label(plan->model, j).text, t, advice);
    }
    if (!(least > LEAST * ale->rest)) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "belt", t, -1, j, least,
                        "the belt on %s and behind it is slack at t = %.9g s, pressed on by a "
                        "tension of %.3g N, %.3g N at rest, %s",
                        bd_pulley_label(plan->model, j).text, t, least, ale->rest, advice);
    }
    const double H = fmax(span->pressing, LEAST * ale->rest), speed = fabs(span->past);
    const double late = ale->bending > 0.0
                            ? ale->bending_damping / ale->bending * speed * sqrt(H / ale->bending)
                            : 0.0;
    if (!(late < LATEST)) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "belt", t, -1, j, late,
                        "at t = %.9g s the belt runs at %.3g m/s through the %.3g mm within which "
                        "it bends behind %s, faster than its damping lets it, "
                        "belt.bending_damping / belt.bending_stiffness = %.3g s, %s",
                        t, speed, 1e3 * sqrt(ale->bending / H),
                        bd_pulley_label(plan->model, j).text, ale->bending_damping / ale->bending,
                        advice);
    }
    const double slope = swings + stands;
    if (!(slope < STEEPEST)) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "belt", t, -1, j, slope,
                        "the span behind %s %s with a slope of %.2g at t = %.9g s, %s, or more "
                        "preload%s",
                        bd_pulley_label(plan->model, j).text,
                        swings > stands ? "swings" : "is bent by its stiffness", slope, t, advice,
                        swings > stands ? ", which shifts resonances (bd.modes tells them)" : "");
    }
    const double bends = sqrt(ale->bending / ale->rest);
    if (!(arc->wrap * arc->radius > fmax(2.0 * bends, LEAST * arc->radius))) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "belt", t, -1, j, arc->wrap,
                        "the belt wraps %s by %.3g rad only at t = %.9g s, %s",
                        bd_pulley_label(plan->model, j).text, arc->wrap, t, advice);
    }
  }
  return BD_OK;
}

/* States beyond the bound of their law, into it. */
static void bound_states(const bd_plan *plan) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale_state *y = &plan->ale->y;
  for (int j = 0; j < lay->np; ++j) {
    const bd_ale_arc *arc = &plan->ale->ale.arcs[j];
    const double bound = plan->contact_pulleys[j].bound;
    for (int e = 0; e < 2 * arc->states && isfinite(bound); ++e) {
      double *z = y->z[e / arc->states] + e % arc->states * y->stride + arc->begin;
      for (int k = 0; k < arc->n; ++k) {
        z[k] = fabs(z[k]) > bound ? copysign(bound, z[k]) : z[k];
      }
    }
  }
}

/* What has been added to states of friction, into `spare`, from those of y. */
static void note_changes(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale_belt *belt = plan->ale;
  for (int k = 0; k < lay->slots * lay->states; ++k) {
    const double *before = bd_cfield(lay, y, F_MU + k);
    const int at = k % lay->states * belt->y.stride;
    for (int c = 0; c < lay->n; ++c) {
      const int slot = at + belt->slot[c];
      belt->spare.z[k / lay->states][slot] = belt->y.z[k / lay->states][slot] - before[c];
    }
  }
}

/* States of the past likewise, else a multistep method would take the difference for an error. */
static void rebase(const bd_plan *plan, double *y) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale_belt *belt = plan->ale;
  for (int k = 0; k < lay->slots * lay->states; ++k) {
    double *z = bd_field(lay, y, F_MU + k);
    for (int c = 0; c < lay->n; ++c) {
      z[c] += belt->spare.z[k / lay->states][k % lay->states * belt->y.stride + belt->slot[c]];
    }
  }
}

/* W stands in a step, and is another in the next: rates are. */
static int after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                      bd_error *err) {
  bd_ale_belt *belt = plan->ale;
  (void)tolerance;
  bd_mounts_put(plan, y);
  bd_ale_put_axes(plan, y);
  bd_ale_read(plan, y, &belt->y);
  if (belt->ale.moving) {
    belt->kernels->place(&belt->ale);
  }
  belt->kernels->stretch(&belt->ale, &belt->y);
  BD_TRY(check_limits(plan, t, err));
  renew(belt, &belt->y);
  belt->known = 0;
  bound_states(plan);
  note_changes(plan, y);
  *changed = 1;
  bd_ale_write(plan, &belt->y, y);
  return BD_OK;
}

/* --- what others ask ---------------------------------------------------------------------- */

static bd_contact_rounding rounding(const bd_plan *plan, const double *y, int j) {
  (void)plan, (void)y, (void)j;
  return (bd_contact_rounding){.least = -1};
}

static double off_line(bd_plan *plan, const double *y, const double *y_new, double h) {
  (void)plan, (void)y, (void)y_new, (void)h;
  return 0.0;
}

/* Whose energy is among that of the belt. */
static int contact_energy(const bd_plan *plan, const double *y, int j, double *stored) {
  (void)plan, (void)y, (void)j, (void)stored;
  return 1; /* or the run has ended */
}

static int turns(const bd_plan *plan, const double *y, int j) {
  (void)y;
  return plan->model->winding[j];
}

const bd_belt_model bd_belt_ale = {
    .facts = {.mesh = BD_MESH_ALE,
              .name = "ale",
              .text = "cells of a mesh that stands where the pulleys are, through which the belt "
                      "flows",
              .nodes = "cells",
              .note = "",
              .model = BD_BELT_AUTO,
              .flows = 1,
              .bends = 1,
              .mounts = 1,
              .smooth = 1,
              .shear = 4.0,
              .explicit_share = 0.8,
              .error_by_local = 1.0,
              .error_by_balance = 0.1,
              .implicit_cost = 5.0,
              .by_rtol = 1.0,
              .fields = 1u << F_M | 1u << F_V | 1u << F_MU,
              .lacks = 1u << BD_SIZE_LINKS | 1u << BD_SIZE_SLOTS | 1u << BD_SIZE_SLIPS},
    .newton = &bd_newton_ale,
    .joints_text = {"belt that flows through its mesh",
                    "belt that flows through its mesh, bending"},
    .carve_drive = carve_drive,
    .shape = shape,
    .cells = cells,
    .weigh = bd_ale_weigh,
    .set_going = bd_ale_set_going,
    .rest = bd_ale_rest,
    .carve = carve,
    .joints = joints,
    .fall = fall,
    .contact = contact,
    .contact_begin = contact_begin,
    .contact_end = contact_end,
    .carry = carry,
    .joints_at = bd_ale_joints_at,
    .contact_energy = contact_energy,
    .list = list,
    .begin = begin,
    .after_step = after_step,
    .rebase = rebase,
    .error = bd_ale_error,
    .push = bd_ale_push,
    .contact_outputs = bd_ale_contact_outputs,
    .rounding = rounding,
    .off_line = off_line,
    .energy = bd_ale_stored,
    .turns = turns,
    .stretch_difference = bd_ale_stretch_difference,
};
