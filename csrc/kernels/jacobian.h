/* SPDX-License-Identifier: MIT
 *
 * The linearised model, compiled once per instruction level: what newton_system.c needs of every
 * link, in loops over the blocks of the state's layout. newton_system.c has the derivation and the
 * names.
 */

#include "kernels/blocks.h"

/* --- joints ---------------------------------------------------------------------------------- */

/* Keeps of the last evaluation, at y, what the joints' linearisation needs: later evaluations, at
 * other states, write over the links' directions. */
static void linearise_joints(const bd_links *links, const double *y, const bd_tangent *tangent) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *vphi = bd_cfield(lay, y, F_VPHI), *co = links->cos, *si = links->sin;
  double *lx = links->fx, *ly = links->fy, *rx = links->rx, *ry = links->ry;
  const bd_tangent t = *tangent;
  const vec half = splat(links->half), inv_half = splat(1.0 / links->half);
  const vec stiffness = splat(links->stiffness), damping = splat(links->damping);
  /* what each end of a link adds to the force of its joint */
  for (int i = 0; i < n8; i += WIDTH) {
    const vec c = load(co + i), s = load(si + i), w = load(vphi + i);
    const vec hc = half * c, hs = half * s, turning = damping * w;
    const vec ex = fnma_(turning, hs, stiffness * hc), ey = fma_(turning, hc, stiffness * hs);
    const vec sx = fma_(stiffness, load(x + i), damping * load(vx + i));
    const vec sy = fma_(stiffness, load(yy + i), damping * load(vy + i));
    store(lx + i, sx - ex);
    store(ly + i, sy - ey);
    store(rx + i, sx + ex);
    store(ry + i, sy + ey);
    store(t.cos + i, c);
    store(t.sin + i, s);
    store(t.spin + i, w);
  }
  rx[-1] = rx[n - 1];
  ry[-1] = ry[n - 1];
  lx[n] = lx[0];
  ly[n] = ly[0];
  for (int i = 0; i < n8; i += WIDTH) {
    const vec fx =
        (load(lx + i) - load_unaligned(rx + i - 1)) + (load_unaligned(lx + i + 1) - load(rx + i));
    const vec fy =
        (load(ly + i) - load_unaligned(ry + i - 1)) + (load_unaligned(ly + i + 1) - load(ry + i));
    store(t.pull + i, inv_half * fma_(load(co + i), fx, load(si + i) * fy));
  }
  t.cos[-1] = t.cos[n - 1];
  t.sin[-1] = t.sin[n - 1];
  t.spin[-1] = t.spin[n - 1];
}

/* The diagonal blocks without contact, and what turning a link moves its ends' forces by. */
static void diagonal(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                     const bd_blocks *blocks) {
  const int n8 = links->lay.n8;
  const bd_tangent t = *tangent;
  const bd_blocks b = *blocks;
  const double g2_half = stage->g * stage->g * links->half;
  const vec straight = splat(2.0 * b.k + stage->mass), none = splat(0.0);
  const vec turning = splat(stage->mass / stage->slender + 2.0 * (b.k + b.bending));
  const vec g2 = splat(stage->g * stage->g);
  const vec along = splat(g2_half * links->stiffness), across = splat(g2_half * links->damping);
  for (int i = 0; i < n8; i += WIDTH) {
    const vec turn = across * load(t.spin + i), c = load(t.cos + i), s = load(t.sin + i);
    store(b.xx + i, straight);
    store(b.xy + i, none);
    store(b.yx + i, none);
    store(b.yy + i, straight);
    store(b.pp + i, fma_(g2, load(t.pull + i), turning));
    store(t.end_x + i, fma_(turn, c, along * s));
    store(t.end_y + i, fnma_(along, c, turn * s));
  }
}

/* What both ends of links are worth to the force of a joint, one component. */
typedef struct end_forces {
  vec left, right;
} end_forces;

INLINE end_forces ends_force(vec stiffness, vec move, vec turn) {
  return (end_forces){.left = fma_(stiffness, move, turn), .right = fma_(stiffness, move, -turn)};
}

/* r = M b_v + g F_q b_q of the joints, b = g c, in one pass: joint i pulls with what the left end
 * of link i and the right end of the link before are worth, in the registers of two blocks. */
static void joints_product(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                           const double *c, double *x, double *y, double *p) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const int n = lay->n, n8 = lay->n8;
  const double g = stage->g, half = links->half;
  const vec mass = splat(g / links->inv_mass),
            inertia = splat(g / links->inv_mass * half / stage->slender);
  const vec stiffness = splat(g * g * links->stiffness), back = splat(-g * g * half);
  const vec bend = splat(g * g * links->bending / half), lane = lane_numbers();
  const double *cx = bd_cfield(lay, c, F_X), *cvx = bd_cfield(lay, c, F_VX);
  const int stride = lay->stride;
  const double *cy = cx + stride, *cp = cy + stride;
  const vec turn = splat(cp[n - 1]);
  vec last[3] = {ends_force(stiffness, splat(cx[n - 1]), splat(t.end_x[n - 1]) * turn).right,
                 ends_force(stiffness, splat(cy[n - 1]), splat(t.end_y[n - 1]) * turn).right,
                 bend * turn};
  vec here[3] = {last[0], last[1], last[2]}, first[3] = {last[0], last[1], last[2]};
  for (int i = 0; i <= n8; i += WIDTH) {
    vec next[3] = {first[0], first[1], first[2]};
    if (i < n8) {
      const vec angle = load(cp + i);
      const end_forces fx = ends_force(stiffness, load(cx + i), load(t.end_x + i) * angle);
      const end_forces fy = ends_force(stiffness, load(cy + i), load(t.end_y + i) * angle);
      const vec right[3] = {fx.right, fy.right, bend * angle};
      next[0] = fx.left - from_left(last[0], fx.right);
      next[1] = fy.left - from_left(last[1], fy.right);
      next[2] = right[2] - from_left(last[2], right[2]);
      for (int k = 0; k < 3; ++k) {
        if (i == 0) {
          first[k] = splat(first_of(next[k]));
        }
        if (i + WIDTH > n) { /* after the last link comes the first */
          next[k] = choose(less(lane, splat(n - i)), next[k], first[k]);
        }
        last[k] = right[k];
      }
    }
    if (i > 0) {
      const int j = i - WIDTH;
      vec ahead[3];
      for (int k = 0; k < 3; ++k) {
        ahead[k] = from_right(here[k], next[k]);
      }
      vec turning = fma_(load(t.cos + j), here[1] + ahead[1], ahead[2] - here[2]);
      turning = fnma_(load(t.sin + j), here[0] + ahead[0], turning);
      turning = fma_(back * load(t.pull + j), load(cp + j), turning);
      store(x + j, fma_(mass, load(cvx + j), ahead[0] - here[0]));
      store(y + j, fma_(mass, load(cvx + stride + j), ahead[1] - here[1]));
      store(p + j, fma_(inertia, load(cvx + 2 * stride + j), turning));
    }
    for (int k = 0; k < 3; ++k) {
      here[k] = next[k];
    }
  }
}

/* The ring's blocks without contact, where they are assembled. */
static void fill_ring_links(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                            const bd_blocks *b, const bd_assembled *out) {
  const bd_layout *lay = &links->lay;
  const double g2_ = stage->g * stage->g, half = links->half;
  const vec g2 = splat(g2_), none = splat(0.0), spin = splat(g2_ * links->damping);
  tangent->cos[lay->n] = tangent->cos[0];
  tangent->sin[lay->n] = tangent->sin[0];
  tangent->spin[lay->n] = tangent->spin[0];
  for (int m = 0; m < 2; ++m) { /* Q, then W, which has the other sign */
    const vec k = splat(m ? b->k : g2_ * links->stiffness), two = k + k;
    const vec bend = splat(m ? b->bending : g2_ * links->bending / (half * half));
    const vec straight = m ? two + splat(stage->mass) : two;
    const vec bent = bend + bend + two + splat(m ? stage->mass / stage->slender : 0.0);
    const vec sign = splat(m ? 1.0 : -1.0), turned = splat(m ? 1.0 : -half);
    double *const to = m ? out->w : out->q;
    for (int i = 0; i < lay->n8; i += WIDTH) {
      const vec c = load(tangent->cos + i), s = load(tangent->sin + i);
      const vec cl = load_unaligned(tangent->cos + i - 1);
      const vec sl = load_unaligned(tangent->sin + i - 1);
      const vec ca = load_unaligned(tangent->cos + i + 1);
      const vec sa = load_unaligned(tangent->sin + i + 1);
      const vec w = spin * load_unaligned(tangent->spin + i + 1);
      const vec wl = spin * load_unaligned(tangent->spin + i - 1);
      const vec qx = fma_(k, sa, w * ca), qy = fnma_(k, ca, w * sa);
      const vec qxl = fma_(k, sl, wl * cl), qyl = fnma_(k, cl, wl * sl);
      const vec entries[3][9] = {
          {-k, none, qxl, none, -k, qyl, -(k * s), k * c, fma_(s, qxl, -fma_(c, qyl, bend))},
          {straight, none, none, none, straight, none, none, none,
           fma_(g2, load(tangent->pull + i), bent)},
          {-k, none, -qx, none, -k, -qy, k * s, -(k * c), fma_(s, qx, -fma_(c, qy, bend))}};
      for (int place = 0; place < 3; ++place) {
        for (int e = 0; e < 9; ++e) {
          store(entry_of(to, 3, i, place, e), (e % 3 == 2 ? turned : sign) * entries[place][e]);
        }
      }
    }
  }
}

/* --- contact --------------------------------------------------------------------------------- */

INLINE void linearise_contact(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                              const bd_run *runs, const double *y,
                              const bd_contact_tangent *contact, double h, const int law,
                              const int general, const int states, const int hunt_crossley) {
  const bd_layout *lay = &links->lay;
  const bd_contact_tangent t = *contact;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *zs = bd_cfield(lay, y, states != 0 ? bd_f_state(lay, pulley->slot) : F_X);
  const vec cx = splat(pulley->x), cy = splat(pulley->y);
  const vec cu = splat(pulley->vx), cv = splat(pulley->vy);
  const vec radius = splat(pulley->radius), omega = splat(pulley->omega), step = splat(h);
  const vec quadratic = splat(pulley->quadratic), twice_quadratic = quadratic + quadratic;
  const vec linear = splat(pulley->linear);
  const contact_damping damping = contact_damping_of(pulley);
  const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
  const vec none = splat(0.0), half = splat(0.5);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const mask link = less(none, load(links->link_mask + i));
      const vec dx = load(x + i) - cx, dy = load(yy + i) - cy;
      vec rho, inv;
      root_and_inverse(fma_(dx, dx, dy * dy), &rho, &inv);
      const vec nx = dx * inv, ny = dy * inv, p = radius - rho;
      const vec ux = load(vx + i) - cu, uy = load(vy + i) - cv;
      const vec apart = fma_(ux, nx, uy * ny), around = fnma_(ux, ny, uy * nx);
      const vec secant = fma_(quadratic, p, linear);
      const vec damp = damping_at(&damping, secant * p, hunt_crossley);
      const vec raw = fma_(secant, p, -(damp * apart));
      /* a straight step leaves the rim by this much */
      const vec arc_travel = step * around, leave = half * arc_travel * arc_travel * inv;
      const mask touching = link & less(none, p), pressed = touching & less(none, raw);
      const mask landing = except(link & less(leave, fnma_(step, apart, p)), touching);
      const mask on = touching | landing, pushing = pressed | landing;
      const vec slide = fnma_(omega, rho, around), normal = where(pressed, raw);
      law_at at = {
          .v = general ? where(touching, slide) : slide, .normal = normal, .touch = touching};
      vec force = none, by_normal = none, by_slip = none;
      for (int e = 0; e < law_elements(pulley, states); ++e) {
        const int k = e * lay->stride + i;
        at.element = e;
        at.z = states != 0 ? load(zs + k) : none;
        const law_slopes slopes = law_slopes_of(&constants, &at, law);
        by_normal = e == 0 ? slopes.by_normal : by_normal + slopes.by_normal;
        if (general) {
          const vec own = law_value_of(&constants, &at, law).force;
          force = e == 0 ? own : force + own;
          by_slip = e == 0 ? slopes.by_slip : by_slip + slopes.by_slip;
        }
        if (general && states != 0) {
          store(t.by_state + k, where(touching, slopes.by_state));
          store(t.gain_normal + k, where(touching, slopes.rate_by_normal));
        }
        if (states != 0) {
          store(t.gain + k, where(touching, slopes.rate_by_slip));
          store(t.decay + k, where(touching, -slopes.rate_by_state));
        }
      }
      const vec of_elastic = choose(landing, linear, fma_(twice_quadratic, p, linear));
      const vec stiff = stiffness_at(&damping, of_elastic, -apart, hunt_crossley);
      const vec pressing_damp = hunt_crossley ? choose(landing, damping.linear, damp) : damp;
      const vec lands = where(landing, fma_(stiff, p, -(damping.linear * apart)));
      store(t.nx + i, where(on, nx));
      store(t.ny + i, where(on, ny));
      store(t.rho + i, where(on, rho));
      store(t.normal_over_rho + i, where(pressed, raw * inv));
      store(t.normal + i, normal);
      if (general) {
        store(t.mu + i, where(pressed, force / choose(pressed, normal, splat(1.0))));
        store(t.by_normal + i, where(touching, by_normal));
        store(t.by_slip + i, where(touching, by_slip));
      } else {
        store(t.mu + i, where(touching, by_normal));
      }
      store(t.stiff + i, where(pushing, stiff));
      store(t.damp + i, where(pushing, pressing_damp));
      store(t.cross + i, where(pushing, pressing_damp * around * inv));
      store(t.apart + i, where(on, apart * inv));
      store(t.normal_correction + i, where(pushing, fnma_(stiff, leave, lands)));
    }
  }
}

#define LINEARISE(law, general, states)                                                            \
  static void linearise_contact_##law(const bd_links *links, const bd_contact_pulley *pulley,      \
                                      int n_runs, const bd_run *runs, const double *y,             \
                                      const bd_contact_tangent *contact, double h) {               \
    if (pulley->hunt_crossley > 0.0) {                                                             \
      linearise_contact(links, pulley, n_runs, runs, y, contact, h, BD_LAW_##law, general, states, \
                        1);                                                                        \
    } else {                                                                                       \
      linearise_contact(links, pulley, n_runs, runs, y, contact, h, BD_LAW_##law, general, states, \
                        0);                                                                        \
    }                                                                                              \
  }
#define LAW(name, class, general, states, text) LINEARISE(name, general, states)
LINEARISE(NONE, 0, 0)
BD_LAWS(LAW)
#undef LAW

/* Adds to a rate what N will be beyond its tangent; returns its torque on the pulley. */
INLINE double add_normal_correction(const bd_links *links, const bd_contact_pulley *pulley,
                                    int n_runs, const bd_run *runs,
                                    const bd_contact_tangent *contact, double *c, const int general,
                                    const int states) {
  const bd_layout *lay = &links->lay;
  const bd_contact_tangent t = *contact;
  const vec inv_mass = splat(links->inv_mass);
  double *cvx = bd_field(lay, c, F_VX), *cvy = bd_field(lay, c, F_VY);
  double *cz = bd_field(lay, c, states != 0 ? bd_f_state(lay, pulley->slot) : F_X);
  vec torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec more = load(t.normal_correction + i), drag = load(t.by_normal + i) * more;
      const vec nx = load(t.nx + i), ny = load(t.ny + i);
      store(cvx + i, fma_(inv_mass, fma_(more, nx, drag * ny), load(cvx + i)));
      store(cvy + i, fma_(inv_mass, fnma_(drag, nx, more * ny), load(cvy + i)));
      torque = fma_(drag, load(t.rho + i), torque);
      for (int e = 0; general && e < law_states(pulley, states); ++e) {
        const int k = e * lay->stride + i;
        store(cz + k, fma_(load(t.gain_normal + k), more, load(cz + k)));
      }
    }
  }
  return sum(torque);
}

/* A 2 x 2 block, rows first, from the axes (n, t) of a link to those of the plane. */
typedef struct plane_block {
  vec xx, xy, yx, yy;
} plane_block;

INLINE plane_block turned_back(vec nx, vec ny, vec nn, vec nt, vec tn, vec tt) {
  const vec nx2 = nx * nx, ny2 = ny * ny, nx_ny = nx * ny;
  const vec nn_tt = nx_ny * (nn - tt), both = nx_ny * (nt + tn);
  return (plane_block){.xx = fma_(nx2, nn, fma_(ny2, tt, -both)),
                       .xy = fma_(nx2, nt, fnma_(ny2, tn, nn_tt)),
                       .yx = fma_(nx2, tn, fnma_(ny2, nt, nn_tt)),
                       .yy = fma_(ny2, nn, fma_(nx2, tt, both))};
}

/* Adds one pulley's contact to the diagonal blocks, sets its border and what solves need for g;
 * returns what the pulley's own equation gets. */
INLINE double add_contact(const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                          const bd_contact_tangent *contact, double g, const bd_blocks *blocks,
                          double *column_x, double *column_y, const int general, const int states) {
  const bd_contact_tangent t = *contact;
  const bd_blocks b = *blocks;
  const vec step = splat(g), g2 = splat(g * g), one = splat(1.0);
  const vec omega = splat(pulley->omega), travel = splat(g * pulley->omega);
  vec own = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec nx = load(t.nx + i), ny = load(t.ny + i), rho = load(t.rho + i);
      const vec mu = load(t.mu + i), apart = load(t.apart + i);
      /* dF, times g, with what N and v_T do to the states within the step */
      vec by_normal = general ? load(t.by_normal + i) : mu, by_slip = splat(0.0);
      for (int e = 0; e < law_states(pulley, states); ++e) {
        const int k = e * pulley->stride + i;
        const vec decay_factor = 1.0 / fma_(step, load(t.decay + k), one);
        const vec state_by_slip = step * load(t.gain + k) * decay_factor;
        const vec by_state = load(t.by_state + k), slipped = by_state * step * state_by_slip;
        by_slip = e == 0 ? slipped : by_slip + slipped;
        if (general) {
          const vec state_by_normal = step * load(t.gain_normal + k) * decay_factor;
          by_normal = fma_(by_state, state_by_normal, by_normal);
          store(t.state_by_normal + k, state_by_normal);
        }
        store(t.by_given_state + k, g2 * by_state * decay_factor);
        store(t.state_by_slip + k, state_by_slip);
        store(t.decay_factor + k, decay_factor);
      }
      by_slip = general ? fma_(step, load(t.by_slip + i), by_slip) : by_slip;
      const vec normal = g2 * load(t.normal + i), cross = g2 * load(t.cross + i);
      const vec normal_over_rho = g2 * load(t.normal_over_rho + i);
      const vec stiff = g2 * load(t.stiff + i), press = fma_(step, load(t.damp + i), stiff);
      const vec by_turning = by_slip * travel;
      const vec dragged = fma_(by_normal, cross, normal_over_rho);
      /* by velocities */
      const vec nt = fnma_(normal_over_rho, mu, cross), tn = -fma_(by_normal, press, by_turning);
      const vec tt = fma_(by_slip, fnma_(step, apart, one), -dragged);
      const plane_block by_velocity = turned_back(nx, ny, press, nt, tn, tt);
      store(b.xx + i, load(b.xx + i) + by_velocity.xx);
      store(b.xy + i, load(b.xy + i) + by_velocity.xy);
      store(b.yx + i, load(b.yx + i) + by_velocity.yx);
      store(b.yy + i, load(b.yy + i) + by_velocity.yy);
      const vec to_pulley_n = -fma_(rho, tn, normal * mu), to_pulley_t = -fma_(rho, tt, normal);
      const vec spin_column = by_slip * rho;
      store(t.row_x + i, fnma_(ny, to_pulley_t, nx * to_pulley_n));
      store(t.row_y + i, fma_(ny, to_pulley_n, nx * to_pulley_t));
      store(column_x + i, ny * spin_column);
      store(column_y + i, -nx * spin_column);
      own = fma_(spin_column, rho, own);
      /* by what a solve is given for positions and friction */
      const vec given_tn = fma_(by_normal, stiff, by_turning);
      const vec given_tt = fma_(by_slip, step * apart, dragged);
      const plane_block by_position = turned_back(nx, ny, -stiff, -nt, given_tn, given_tt);
      const vec torque_n = fnma_(rho, given_tn, normal * mu);
      const vec torque_t = fnma_(rho, given_tt, normal);
      store(t.xx + i, by_position.xx);
      store(t.xy + i, by_position.xy);
      store(t.yx + i, by_position.yx);
      store(t.yy + i, by_position.yy);
      store(t.torque_x + i, fnma_(ny, torque_t, nx * torque_n));
      store(t.torque_y + i, fma_(ny, torque_n, nx * torque_t));
      store(t.slide_x + i, fnma_(nx, omega, ny * apart));
      store(t.slide_y + i, -fma_(nx, apart, ny * omega));
    }
  }
  return sum(own);
}

/* Adds one pulley's contact to g F_q b_q and g F_mu's part; returns the pulley's own. */
static double contact_product(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                              const bd_run *runs, const bd_contact_tangent *contact,
                              const double *c, double *x, double *y) {
  const bd_contact_tangent t = *contact;
  const double *cx = bd_cfield(lay, c, F_X), *cy = bd_cfield(lay, c, F_Y);
  const double *cz = bd_cfield(lay, c, bd_f_state(lay, pulley->slot));
  vec torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const vec bx = load(cx + i), by = load(cy + i);
      vec fx = fma_(load(t.xy + i), by, fma_(load(t.xx + i), bx, load(x + i)));
      vec fy = fma_(load(t.yy + i), by, fma_(load(t.yx + i), bx, load(y + i)));
      torque = fma_(load(t.torque_y + i), by, fma_(load(t.torque_x + i), bx, torque));
      for (int e = 0; e < pulley->states; ++e) {
        const int k = e * lay->stride + i;
        const vec change = load(t.by_given_state + k) * load(cz + k);
        fx = fma_(load(t.ny + i), change, fx);
        fy = fnma_(load(t.nx + i), change, fy);
        torque = fma_(load(t.rho + i), change, torque);
      }
      store(x + i, fx);
      store(y + i, fy);
    }
  }
  return sum(torque);
}

/* The friction unknowns of one pulley's contact; everything else of c is solved. */
INLINE void finish_contact(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                           const bd_run *runs, const bd_contact_tangent *contact, double g,
                           double angular_acceleration, double *c, const int general,
                           const int states) {
  const bd_contact_tangent t = *contact;
  const double *cx = bd_cfield(lay, c, F_X), *cy = bd_cfield(lay, c, F_Y);
  const double *cvx = bd_cfield(lay, c, F_VX), *cvy = bd_cfield(lay, c, F_VY);
  double *cz = bd_field(lay, c, bd_f_state(lay, pulley->slot));
  double *cslip = bd_field(lay, c, bd_f_slip(lay, pulley->slot));
  const vec spin = splat(angular_acceleration), step = splat(g);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      vec slide = load(t.slide_x + i) * load(cx + i);
      slide = fma_(load(t.slide_y + i), load(cy + i), slide);
      slide = fma_(load(t.nx + i), load(cvy + i), slide);
      slide = fnma_(load(t.ny + i), load(cvx + i), slide);
      slide = fnma_(load(t.rho + i), spin, slide);
      vec normal = splat(0.0); /* -dN */
      if (general && states != 0) {
        const vec nx = load(t.nx + i), ny = load(t.ny + i);
        const vec rn = fma_(nx, load(cx + i), ny * load(cy + i));
        const vec rt = fnma_(ny, load(cx + i), nx * load(cy + i));
        const vec vn = fma_(nx, load(cvx + i), ny * load(cvy + i));
        normal = fma_(load(t.stiff + i), rn, load(t.damp + i) * vn);
        normal = fma_(load(t.cross + i), rt, normal);
      }
      for (int e = 0; e < law_states(pulley, states); ++e) {
        const int k = e * lay->stride + i;
        vec z = fma_(load(t.state_by_slip + k), slide, load(t.decay_factor + k) * load(cz + k));
        z = general ? fnma_(load(t.state_by_normal + k), normal, z) : z;
        store(cz + k, z);
      }
      store(cslip + i, fma_(step, slide, load(cslip + i)));
    }
  }
}

/* The row of one pulley times a vector. */
static double border_row(int n_runs, const bd_run *runs, const bd_contact_tangent *contact,
                         const double *x, const double *y) {
  const bd_contact_tangent t = *contact;
  vec along_x = splat(0.0), along_y = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      along_x = fma_(load(t.row_x + i), load(x + i), along_x);
      along_y = fma_(load(t.row_y + i), load(y + i), along_y);
    }
  }
  return sum(along_x + along_y);
}

#include "kernels/link_contact_tangent.h"

#include "kernels/contact_points.h"
#include "kernels/string_jacobian.h"

/* For each form of friction, with what it needs alone. */
#define FORM(form, general, states)                                                                \
  static double add_normal_correction_##form(                                                      \
      const bd_links *links, const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,      \
      const bd_contact_tangent *contact, double *c) {                                              \
    return add_normal_correction(links, pulley, n_runs, runs, contact, c, general, states);        \
  }                                                                                                \
  static double add_contact_##form(const bd_contact_pulley *pulley, int n_runs,                    \
                                   const bd_run *runs, const bd_contact_tangent *contact,          \
                                   double g, const bd_blocks *blocks, double *column_x,            \
                                   double *column_y) {                                             \
    return add_contact(pulley, n_runs, runs, contact, g, blocks, column_x, column_y, general,      \
                       states);                                                                    \
  }                                                                                                \
  static void finish_contact_##form(                                                               \
      const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,       \
      const bd_contact_tangent *contact, double g, double angular_acceleration, double *c) {       \
    finish_contact(lay, pulley, n_runs, runs, contact, g, angular_acceleration, c, general,        \
                   states);                                                                        \
  }
FORM(NONE, 0, 0)
FORM(PLAIN, 0, 1)
FORM(STATELESS, 1, 0)
FORM(GENERAL, 1, 1)
FORM(SEVERAL, 1, BD_SEVERAL)

#define FORMS(function)                                                                            \
  function##_NONE, function##_PLAIN, function##_STATELESS, function##_GENERAL, function##_SEVERAL

const bd_newton_kernels PASTE(bd_newton_, BD_LEVEL) = {
    .width = WIDTH,
    .unknowns = 3,
    .ring_row = sizeof(ring_row),
    .ring_ends = sizeof(ring_ends),
    .factor = {ring_factor_0, ring_factor_1},
    .solve = {ring_solve_0, ring_solve_1},
    .linearise_joints = linearise_joints,
    .diagonal = diagonal,
    .joints_product = joints_product,
    .finish_nodes = finish_nodes_links,
#define LAW(name, class, general, states, text) [BD_LAW_##name] = linearise_contact_##name,
    .linearise_contact = {linearise_contact_NONE, BD_LAWS(LAW)},
#undef LAW
    .add_normal_correction = {FORMS(add_normal_correction)},
    .add_contact = {FORMS(add_contact)},
    .contact_product = contact_product,
    .finish_contact = {FORMS(finish_contact)},
    .border_row = border_row,
#define LAW(name, class, general, states, text) [BD_LAW_##name] = fill_pulley_##name##_links,
    .fill_ring = fill_ring_links,
    .fill_pulley = {fill_pulley_NONE_links, BD_LAWS(LAW)},
#undef LAW
    .blocks_product = blocks_product_links,
    .states_product = states_product_links,
    .row_runs = row_runs_links,
    .add_column = add_column_links,
    .restore_states = restore_states_links,
    .sum_runs = sum_runs,
};

const bd_newton_kernels PASTE(bd_newton_string_, BD_LEVEL) = {
    .width = WIDTH,
    .unknowns = 2,
    .ring_row = sizeof(string_row),
    .ring_ends = sizeof(string_ends),
    .factor = {NULL, string_factor},
    .solve = {NULL, string_solve},
    .linearise_joints = string_linearise_joints,
    .finish_nodes = finish_nodes_string,
#define LAW(name, class, general, states, text) [BD_LAW_##name] = fill_pulley_##name##_string,
    .fill_ring = fill_ring_string,
    .fill_pulley = {fill_pulley_NONE_string, BD_LAWS(LAW)},
#undef LAW
    .blocks_product = blocks_product_string,
    .states_product = states_product_string,
    .row_runs = row_runs_string,
    .add_column = add_column_string,
    .restore_states = restore_states_string,
    .sum_runs = sum_runs,
};
