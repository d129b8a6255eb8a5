/* SPDX-License-Identifier: MIT
 *
 * Contact along the links in the rate, compiled once per instruction level, in rhs.h; equations and
 * names in link_geometry.h.
 */
#include "kernels/link_geometry.h"

/* A vector of links pressed on a pulley: normal forces at their two ends, shares in contact of the
 * halves that belong to the joints there, and their rates. Power lost and energy stored are added.
 */
typedef struct normal_forces {
  vec left, right, share_left, share_right, rate_left, rate_right;
} normal_forces;

INLINE normal_forces link_normal_forces(const bd_contact_pulley *pulley, const link_end *a,
                                        const link_end *b, const int ledger,
                                        const int hunt_crossley, vec *loss, vec *energy) {
  const vec none = splat(0.0), one = splat(1.0), half = splat(0.5), third = splat(1.0 / 3.0);
  const vec quadratic = splat(pulley->quadratic), linear = splat(pulley->linear);
  const contact_damping damping = contact_damping_of(pulley);
  const contact_part part = part_of(a, b);
  const vec share = part.x1 - part.x0, middle = half * (part.x0 + part.x1);
  const vec weight = half * share;
  normal_forces out = {.left = none, .right = none};
  for (int g = -1; g <= 1; g += 2) {
    const vec x = fma_(splat(g * GAUSS), share, middle), back = one - x;
    const vec p = fma_(back, a->p, x * b->p), rate = fma_(back, a->rate, x * b->rate);
    const vec elastic = fma_(quadratic, p, linear) * p;
    const vec damped = damping_at(&damping, elastic, hunt_crossley);
    const vec q = weight * larger(fma_(damped, rate, elastic), none);
    out.left = fma_(q, back, out.left);
    out.right = fma_(q, x, out.right);
    if (ledger) {
      *loss = fma_(fnma_(weight, elastic, q), rate, *loss);
      *energy = fma_(weight * p * p, fma_(third * quadratic, p, half * linear), *energy);
    }
  }
  const vec turning = part.moves * part.cut_rate;
  out.share_right = half * fnma_(part.x0, part.x0, part.x1 * part.x1);
  out.share_left = share - out.share_right;
  out.rate_left = turning * (one - part.cut);
  out.rate_right = turning * part.cut;
  return out;
}

/* Normal forces of the links of the runs on one pulley, added at their ends. */
INLINE void add_normal_forces(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                              const bd_run *runs, const bd_pressure *pressure,
                              const bd_end_forces *out, const double *y, bd_sums *sums,
                              const int string, const int ledger, const int hunt_crossley) {
  const bd_pressure to = *pressure;
  const vec radius = splat(pulley->radius), none = splat(0.0), rim2 = radius * radius;
  vec loss = none, energy = none;
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const link_place at = place_of(links, pulley, y, links->cos, links->sin, i, string);
      if (!any(less(nearer_end(&at), rim2))) {
        double *const cleared[] = {to.left,        to.right,     to.share_left,
                                   to.share_right, to.rate_left, to.rate_right};
        for (size_t k = 0; k < sizeof cleared / sizeof cleared[0]; ++k) {
          store(cleared[k] + i, none);
        }
        continue;
      }
      const link_end a = end_at(&at, 0, radius), b = end_at(&at, 1, radius);
      const normal_forces by =
          link_normal_forces(pulley, &a, &b, ledger, hunt_crossley, &loss, &energy);
      store(to.left + i, by.left);
      store(to.right + i, by.right);
      store(to.share_left + i, by.share_left);
      store(to.share_right + i, by.share_right);
      store(to.rate_left + i, by.rate_left);
      store(to.rate_right + i, by.rate_right);
      store(out->left_x + i, fma_(by.left, a.nx, load(out->left_x + i)));
      store(out->left_y + i, fma_(by.left, a.ny, load(out->left_y + i)));
      store(out->right_x + i, fma_(by.right, b.nx, load(out->right_x + i)));
      store(out->right_y + i, fma_(by.right, b.ny, load(out->right_y + i)));
    }
  }
  close_runs((double *[]){to.right, to.share_right, to.rate_right}, 3, n_runs, runs, links->lay.n,
             0.0);
  *sums = (bd_sums){.contact_loss = sum(loss), .contact_energy = sum(energy)};
}

/* Friction of one pulley at the joints of the runs. */
INLINE void add_friction(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                         const bd_run *runs, const bd_points *points, const bd_pressure *pressure,
                         const bd_end_forces *out, const double *y, double *dy, bd_sums *sums,
                         const int law, const int general, const int states, const int ledger) {
  const bd_layout *lay = &links->lay;
  const double *zs = bd_cfield(lay, y, bd_f_state(lay, pulley->slot));
  double *oz = bd_field(lay, dy, bd_f_state(lay, pulley->slot));
  double *oslip = bd_field(lay, dy, bd_f_slip(lay, pulley->slot));
  const vec cx = splat(pulley->x), cy = splat(pulley->y), cu = splat(pulley->vx);
  const vec cv = splat(pulley->vy), omega = splat(pulley->omega);
  const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
  vec torque = splat(0.0), loss = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const joint_contact joint = joint_contact_of(links, pressure, i);
      if (!any(joint.touch)) {
        continue;
      }
      const vec dx = load(points->x + i) - cx, dy_ = load(points->y + i) - cy;
      vec rho, inv;
      root_and_inverse(fma_(dx, dx, dy_ * dy_), &rho, &inv);
      const vec nx = dx * inv, ny = dy_ * inv;
      const vec ux = load(points->vx + i) - cu, uy = load(points->vy + i) - cv;
      const vec v = where(joint.touch, fnma_(omega, rho, fnma_(ux, ny, uy * nx)));
      const law_at at = {.v = v,
                         .normal = general ? joint.normal * joint.inv_share : joint.normal,
                         .touch = joint.touch};
      const vec mean = law_act(&constants, &at, pulley, zs, oz, i, &joint.fresh, law, states);
      const vec force = general ? where(joint.touch, mean * joint.share) : mean;
      store(oslip + i, load(oslip + i) + v);
      store(out->joint_x + i, fma_(force, ny, load(out->joint_x + i)));
      store(out->joint_y + i, fnma_(force, nx, load(out->joint_y + i)));
      torque = fma_(force, rho, torque);
      if (ledger) {
        loss = fma_(force, v, loss);
      }
    }
  }
  sums->torque = sum(torque);
  sums->friction_loss = sum(loss);
}

/* Into the links' scratch, the last one's also before the first. */
static void directions(const bd_links *links, const double *y) {
  const double *phi = bd_cfield(&links->lay, y, F_PHI);
  for (int i = 0; i < links->lay.n8; i += WIDTH) {
    vec c, s;
    sine_cosine(load(phi + i), &s, &c);
    store(links->cos + i, c);
    store(links->sin + i, s);
  }
}

/* Joints as the mean of the ends that meet there. */
static void gather_points(const bd_links *links, const double *co, const double *si,
                          const double *y, const bd_points *points) {
  const bd_layout *lay = &links->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *w = bd_cfield(lay, y, F_VPHI);
  const vec half = splat(0.5), quarter = splat(0.5 * links->half);
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const vec c = load(co + i), s = load(si + i), cl = load_unaligned(co + i - 1);
    const vec sl = load_unaligned(si + i - 1), turn = load(w + i),
              turn_l = load_unaligned(w + i - 1);
    store(points->x + i, fma_(quarter, cl - c, half * (load_unaligned(x + i - 1) + load(x + i))));
    store(points->y + i, fma_(quarter, sl - s, half * (load_unaligned(yy + i - 1) + load(yy + i))));
    store(points->vx + i, fma_(quarter, fnma_(turn_l, sl, turn * s),
                               half * (load_unaligned(vx + i - 1) + load(vx + i))));
    store(points->vy + i, fma_(quarter, fnma_(turn, c, turn_l * cl),
                               half * (load_unaligned(vy + i - 1) + load(vy + i))));
  }
}

/* Adds them to the links' accelerations; the joint after the last link is the first one. */
static void scatter_forces(const bd_links *links, const double *co, const double *si,
                           const bd_end_forces *at_ends, double *dy) {
  const bd_layout *lay = &links->lay;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  double *aphi = bd_field(lay, dy, F_VPHI);
  const vec inv_mass = splat(links->inv_mass), arm = splat(links->half * links->inv_inertia);
  const vec none = splat(0.0);
  at_ends->joint_x[lay->n] = at_ends->joint_x[0];
  at_ends->joint_y[lay->n] = at_ends->joint_y[0];
  for (int i = 0; i < lay->n8; i += WIDTH) {
    const mask link = less(none, load(links->link_mask + i));
    const both_ends f = forces_on(at_ends, i);
    const vec turning = fnma_(load(si + i), f.rx - f.lx, load(co + i) * (f.ry - f.ly));
    store(ax + i, load(ax + i) + where(link, inv_mass * (f.lx + f.rx)));
    store(ay + i, load(ay + i) + where(link, inv_mass * (f.ly + f.ry)));
    store(aphi + i, load(aphi + i) + where(link, arm * turning));
  }
}

/* Squared distance from a pulley's axis of the nearer end of each link of the runs. */
INLINE void nearest_ends(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                         const bd_run *runs, const double *y, double *nearest, const int string) {
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const link_place at = place_of(links, pulley, y, links->cos, links->sin, i, string);
      store(nearest + i, nearer_end(&at));
    }
  }
  close_runs(&nearest, 1, n_runs, runs, links->lay.n, INFINITY);
}

static void sum_forces(int n_runs, const bd_run *runs, const bd_end_forces *at, double out[2]) {
  vec x = splat(0.0), y = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      x += load(at->left_x + i) + load(at->right_x + i) + load(at->joint_x + i);
      y += load(at->left_y + i) + load(at->right_y + i) + load(at->joint_y + i);
    }
  }
  out[0] = sum(x);
  out[1] = sum(y);
}
