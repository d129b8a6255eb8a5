/* SPDX-License-Identifier: MIT
 *
 * Contact along the links as linearised at a state: normal forces, shares and friction, and what
 * penetrations p and their rates p' of the links' ends do to them. Compiled once per instruction
 * level, in jacobian.h; names as in link_geometry.h.
 */
#include "kernels/link_geometry.h"

/* The normal forces of links and what p and p' of their ends, 0 left and 1 right, do to them; and
 * the place where p = 0, and its rate, by p_a and p_b. */
typedef struct normal_linear {
  vec force[2], by[8], cut_by[2], cut_rate_by[2];
  contact_part part;
} normal_linear;

INLINE normal_linear normals_of(const bd_contact_pulley *pulley, const link_end *ends,
                                const int hunt_crossley) {
  const link_end *a = &ends[0], *b = &ends[1];
  const vec none = splat(0.0), one = splat(1.0), half = splat(0.5), two = splat(2.0);
  const vec quadratic = splat(pulley->quadratic), linear = splat(pulley->linear);
  const contact_damping damping = contact_damping_of(pulley);
  normal_linear n = {.part = part_of(a, b)};
  const contact_part part = n.part;
  const mask cut = less(none, part.moves * part.moves);
  const vec share = part.x1 - part.x0, middle = half * (part.x0 + part.x1);
  const vec weight = half * share, inv = where(cut, part.inv_difference);
  const vec twice = two * part.cut_rate;
  n.cut_by[0] = -(b->p * inv * inv);
  n.cut_by[1] = a->p * inv * inv;
  n.cut_rate_by[0] = fnma_(twice, inv, b->rate * inv * inv);
  n.cut_rate_by[1] = fma_(twice, inv, -(a->rate * inv * inv));
  vec cut_by_left = none, cut_by_right = none;
  for (int m = 0; m < 8; ++m) {
    n.by[m] = none;
  }
  n.force[0] = n.force[1] = none;
  for (int g = -1; g <= 1; g += 2) {
    const vec x = fma_(splat(g * GAUSS), share, middle), back = one - x;
    const vec p = fma_(back, a->p, x * b->p), rate = fma_(back, a->rate, x * b->rate);
    const vec elastic = fma_(quadratic, p, linear) * p;
    const vec damped = damping_at(&damping, elastic, hunt_crossley);
    const vec raw = fma_(damped, rate, elastic);
    const mask on = less(none, raw);
    const vec q = where(on, raw);
    const vec steep = stiffness_at(&damping, fma_(two * quadratic, p, linear), rate, hunt_crossley);
    const vec stiff = where(on, weight * steep);
    const vec damp = where(on, weight * damped);
    n.force[0] = fma_(weight * q, back, n.force[0]);
    n.force[1] = fma_(weight * q, x, n.force[1]);
    const vec aa = back * back, ab = back * x, bb = x * x;
    n.by[0] = fma_(aa, stiff, n.by[0]);
    n.by[1] = fma_(ab, stiff, n.by[1]);
    n.by[2] = fma_(aa, damp, n.by[2]);
    n.by[3] = fma_(ab, damp, n.by[3]);
    n.by[5] = fma_(bb, stiff, n.by[5]);
    n.by[7] = fma_(bb, damp, n.by[7]);
    /* the Gauss point's place by that of p = 0, and the weight by it */
    const vec along = fma_(part.moves, splat(g * GAUSS), half);
    const vec slope = along * fma_(stiff, b->p - a->p, damp * (b->rate - a->rate));
    const vec heavier = half * part.moves * q, moved = along * weight * q;
    cut_by_left += fma_(heavier + slope, back, -moved);
    cut_by_right += fma_(heavier + slope, x, moved);
  }
  n.by[4] = n.by[1];
  n.by[6] = n.by[3];
  for (int e = 0; e < 2; ++e) {
    n.by[e] = fma_(cut_by_left, n.cut_by[e], n.by[e]);
    n.by[4 + e] = fma_(cut_by_right, n.cut_by[e], n.by[4 + e]);
  }
  return n;
}

/* What a step of length h does to N beyond its tangent, into `correction`: a straight step leaves
 * the rim by (h v_t)^2 / (2 rho), and where it brings an end into contact, forces and derivatives
 * are those of the penetrations then. */
INLINE void correct(const bd_contact_pulley *pulley, const link_end *ends, double h,
                    normal_linear *n, vec *correction, const int hunt_crossley) {
  const vec none = splat(0.0), step = splat(h), bend = splat(0.5 * h * h);
  link_end later[2] = {ends[0], ends[1]};
  vec leave[2];
  mask lands = less(none, none);
  for (int e = 0; e < 2; ++e) {
    leave[e] = bend * ends[e].around * ends[e].around * ends[e].inv_rho;
    later[e].p = fma_(step, ends[e].rate, ends[e].p - leave[e]);
    lands |= except(less(none, later[e].p), less(none, ends[e].p));
  }
  for (int e = 0; e < 2; ++e) {
    correction[e] = -fma_(n->by[4 * e], leave[0], n->by[4 * e + 1] * leave[1]);
  }
  if (!any(lands)) {
    return;
  }
  const normal_linear then = normals_of(pulley, later, hunt_crossley);
  for (int e = 0; e < 2; ++e) {
    const vec along = step * fma_(then.by[4 * e], ends[0].rate, then.by[4 * e + 1] * ends[1].rate);
    correction[e] = choose(lands, then.force[e] - n->force[e] - along, correction[e]);
  }
  for (int m = 0; m < 8; ++m) {
    n->by[m] = choose(lands, then.by[m], n->by[m]);
  }
}

/* Links: normal forces, shares, and what p and p' of the ends do to them. */
INLINE void linearise_normals(const bd_links *links, const bd_tangent *tangent,
                              const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                              const bd_link_scratch *scratch, const double *y,
                              const bd_link_tangent *contact, double h, const int string,
                              const int hunt_crossley) {
  const bd_link_tangent t = *contact;
  const bd_pressure to = scratch->pressure;
  const vec radius = splat(pulley->radius), none = splat(0.0), one = splat(1.0);
  const vec half = splat(0.5);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const mask link = less(none, load(links->link_mask + i));
      const link_place at = place_of(links, pulley, y, tangent->cos, tangent->sin, i, string);
      const link_end ends[2] = {end_at(&at, 0, radius), end_at(&at, 1, radius)};
      normal_linear n = normals_of(pulley, ends, hunt_crossley);
      vec correction[2] = {none, none};
      if (h > 0.0) {
        correct(pulley, ends, h, &n, correction, hunt_crossley);
      }
      const contact_part part = n.part;
      const vec normal[2] = {where(link, n.force[0]), where(link, n.force[1])};
      for (int m = 0; m < 8; ++m) {
        store(t.by[m] + i, where(link, n.by[m]));
      }
      for (int e = 0; e < 2; ++e) {
        store(t.nx[e] + i, ends[e].nx);
        store(t.ny[e] + i, ends[e].ny);
        store(t.around[e] + i, ends[e].around * ends[e].inv_rho);
        store(t.normal[e] + i, normal[e]);
        store(t.normal_over_rho[e] + i, normal[e] * ends[e].inv_rho);
        store(t.correction[e] + i, where(link, correction[e]));
      }
      const vec of_right = half * fnma_(part.x0, part.x0, part.x1 * part.x1);
      const vec turning = part.moves * part.cut_rate, kept = one - part.cut;
      store(to.left + i, normal[0]);
      store(to.right + i, normal[1]);
      store(to.share_left + i, part.x1 - part.x0 - of_right);
      store(to.share_right + i, of_right);
      store(to.rate_left + i, turning * kept);
      store(to.rate_right + i, turning * part.cut);
      for (int e = 0; e < 2; ++e) {
        const vec place = part.moves * n.cut_by[e], rate = part.moves * n.cut_rate_by[e];
        store(scratch->share_by[e] + i, kept * place);
        store(scratch->share_by[2 + e] + i, part.cut * place);
        store(scratch->rate_by[e] + i, fnma_(part.cut_rate, place, kept * rate));
        store(scratch->rate_by[2 + e] + i, fma_(part.cut_rate, place, part.cut * rate));
      }
    }
  }
  double *const closed[] = {to.right,
                            to.share_right,
                            to.rate_right,
                            scratch->share_by[2],
                            scratch->share_by[3],
                            scratch->rate_by[2],
                            scratch->rate_by[3],
                            t.by[4],
                            t.by[5],
                            t.by[6],
                            t.by[7],
                            t.nx[0],
                            t.nx[1],
                            t.ny[0],
                            t.ny[1],
                            t.around[0],
                            t.around[1],
                            t.normal_over_rho[1],
                            t.correction[1]};
  close_runs(closed, sizeof closed / sizeof closed[0], n_runs, runs, links->lay.n, 0.0);
}

/* A state of friction at joints: what it does to the force; its rate by slip, itself, and all that
 * p and p' of the four ends do to it, through N, the share and, while belt comes into contact, the
 * rate of that. Into the rows that begin at `row`. */
INLINE void linearise_state(const bd_link_scratch *scratch, const joint_contact *joint,
                            const law_at *at, const law_slopes *slopes, int row, int i,
                            const bd_link_tangent *t, const int general) {
  const vec none = splat(0.0), share = general ? joint->share : splat(1.0);
  const int k = row + i;
  store(t->by_state + k, where(joint->touch, share * slopes->by_state));
  store(t->gain + k, where(joint->touch, slopes->rate_by_slip));
  store(t->decay + k, where(joint->touch, joint->fresh - slopes->rate_by_state));
  const vec gain_normal =
      general ? where(joint->touch, slopes->rate_by_normal * joint->inv_share) : none;
  store(t->gain_normal + k, gain_normal);
  const vec per_share = where(less(none, joint->fresh), at->z / (joint->share + splat(FRESH)));
  const vec gain_share = fnma_(gain_normal, at->normal, joint->fresh * per_share);
  for (int m = 0; m < 4; ++m) {
    const vec before = load_unaligned(t->by[4 + m] + i - 1), behind = load(t->by[m] + i);
    vec gain[2] = {gain_normal * before, gain_normal * behind};
    for (int side = 0; side < 2; ++side) {
      const double *share_by = scratch->share_by[2 * (1 - side) + m % 2] + i - (1 - side);
      const double *rate_by = scratch->rate_by[2 * (1 - side) + m % 2] + i - (1 - side);
      const vec place = load_unaligned(share_by);
      if (m < 2) {
        gain[side] = fma_(gain_share, place, gain[side]);
        gain[side] = fnma_(per_share, load_unaligned(rate_by), gain[side]);
      } else {
        gain[side] = fnma_(per_share, place, gain[side]);
      }
      store(t->gains[4 * side + m] + k, where(joint->touch, gain[side]));
    }
  }
}

/* Joints: friction, by slip, states, and all that p and p' of the four ends do to it. */
INLINE void linearise_friction(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                               const bd_run *runs, const bd_points *points,
                               const bd_link_scratch *scratch, const double *y,
                               const bd_link_tangent *contact, const int law, const int general,
                               const int states, const int string) {
  const bd_layout *lay = &links->lay;
  const joint_points from = points_of(lay, points, y, string);
  const bd_link_tangent t = *contact;
  const double *zs = bd_cfield(lay, y, bd_f_state(lay, pulley->slot));
  const vec cx = splat(pulley->x), cy = splat(pulley->y), none = splat(0.0);
  const vec cu = splat(pulley->vx), cv = splat(pulley->vy), omega = splat(pulley->omega);
  const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const joint_contact joint = joint_contact_of(links, &scratch->pressure, i);
      const vec dx = load(from.x + i) - cx, dy = load(from.y + i) - cy;
      vec rho, inv;
      root_and_inverse(fma_(dx, dx, dy * dy), &rho, &inv);
      const vec nx = dx * inv, ny = dy * inv;
      const vec ux = load(from.vx + i) - cu, uy = load(from.vy + i) - cv;
      law_at at = {.v = where(joint.touch, fnma_(omega, rho, fnma_(ux, ny, uy * nx))),
                   .normal = general ? joint.normal * joint.inv_share : joint.normal,
                   .touch = joint.touch};
      const vec share = general ? joint.share : splat(1.0);
      vec value = none, force_by_normal = none, by_slip = none;
      for (int e = 0; e < law_elements(pulley, states); ++e) {
        at.element = e;
        at.z = states != 0 ? load(zs + e * lay->stride + i) : none;
        const law_slopes slopes = law_slopes_of(&constants, &at, law);
        const vec force = law_value_of(&constants, &at, law).force;
        value = e == 0 ? force : value + force;
        force_by_normal = e == 0 ? slopes.by_normal : force_by_normal + slopes.by_normal;
        by_slip = e == 0 ? slopes.by_slip : by_slip + slopes.by_slip;
        if (states != 0) {
          linearise_state(scratch, &joint, &at, &slopes, e * lay->stride, i, &t, general);
        }
      }
      const vec force = where(joint.touch, share * value);
      store(t.joint_nx + i, where(joint.touch, nx));
      store(t.joint_ny + i, where(joint.touch, ny));
      store(t.rho + i, where(joint.touch, rho));
      store(t.force + i, force);
      store(t.force_over_rho + i, force * inv);
      store(t.apart + i, where(joint.touch, fma_(ux, nx, uy * ny) * inv));
      const vec by_normal = where(joint.touch, force_by_normal);
      store(t.by_normal + i, by_normal);
      store(t.by_slip + i, where(joint.touch, share * by_slip));
      const vec by_share =
          general ? where(joint.touch, fnma_(force_by_normal, at.normal, value)) : none;
      for (int m = 0; m < 4; ++m) {
        const vec before = load_unaligned(t.by[4 + m] + i - 1), behind = load(t.by[m] + i);
        vec direct[2] = {by_normal * before, by_normal * behind};
        for (int side = 0; side < 2; ++side) {
          if (m < 2) {
            const double *share_by = scratch->share_by[2 * (1 - side) + m % 2] + i - (1 - side);
            direct[side] = fma_(by_share, load_unaligned(share_by), direct[side]);
          }
          store(t.direct[4 * side + m] + i, where(joint.touch, direct[side]));
        }
      }
    }
  }
}

INLINE void linearise_links(const bd_links *links, const bd_tangent *tangent,
                            const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                            const bd_points *points, const bd_link_scratch *scratch,
                            const double *y, const bd_link_tangent *contact, double h,
                            const int law, const int general, const int states, const int string) {
  if (pulley->hunt_crossley > 0.0) {
    linearise_normals(links, tangent, pulley, n_runs, runs, scratch, y, contact, h, string, 1);
  } else {
    linearise_normals(links, tangent, pulley, n_runs, runs, scratch, y, contact, h, string, 0);
  }
  if (law != BD_LAW_NONE) {
    linearise_friction(links, pulley, n_runs, runs, points, scratch, y, contact, law, general,
                       states, string);
  }
}
