/* SPDX-License-Identifier: MIT
 *
 * Contact of links at their centres (mesh "paper") in the linear systems: into the blocks W and Q,
 * the row and column of the pulley, and what solves need of the states of friction. Compiled once
 * per instruction level, in jacobian.h. Equations in solvers/newton_system.c; a point is a link's
 * centre, its columns are x and y.
 */

/* A vector of links on a pulley as linearised: normal forces, what positions and velocities do to
 * them, what a step does beyond that. */
typedef struct centre_contact {
  vec nx, ny, rho, inv, apart;                      /* n, distance, 1 / rho, v_n / rho */
  vec normal, over_rho, stiff, damp, cross, beyond; /* N, N / rho, dN/dp, dN/dp', times v_t / rho */
  vec slide;
  mask touching, pressed, on;
} centre_contact;

INLINE centre_contact centre_contact_of(const bd_links *links, const bd_contact_pulley *pulley,
                                        const double *y, vec step, int i, const int hunt_crossley) {
  const double *at = bd_cfield(&links->lay, y, F_X) + i;
  const double *rate = bd_cfield(&links->lay, y, F_VX) + i;
  const int stride = links->lay.stride;
  const vec quadratic = splat(pulley->quadratic), linear = splat(pulley->linear);
  const vec twice_quadratic = quadratic + quadratic, none = splat(0.0), half = splat(0.5);
  const contact_damping damping = contact_damping_of(pulley);
  const mask link = less(none, load(links->link_mask + i));
  const vec dx = load(at) - splat(pulley->x), dy = load(at + stride) - splat(pulley->y);
  const vec ux = load(rate) - splat(pulley->vx), uy = load(rate + stride) - splat(pulley->vy);
  vec rho, inv;
  root_and_inverse(fma_(dx, dx, dy * dy), &rho, &inv);
  const vec nx = dx * inv, ny = dy * inv, p = splat(pulley->radius) - rho;
  const vec apart = fma_(ux, nx, uy * ny), around = fnma_(ux, ny, uy * nx);
  const vec secant = fma_(quadratic, p, linear);
  const vec damp = damping_at(&damping, secant * p, hunt_crossley);
  const vec raw = fma_(secant, p, -(damp * apart));
  /* a straight step leaves the rim by this much */
  const vec arc_travel = step * around, leave = half * arc_travel * arc_travel * inv;
  const mask touching = link & less(none, p), pressed = touching & less(none, raw);
  const mask landing = except(link & less(leave, fnma_(step, apart, p)), touching);
  const mask on = touching | landing, pushing = pressed | landing;
  const vec of_elastic = choose(landing, linear, fma_(twice_quadratic, p, linear));
  const vec stiff = stiffness_at(&damping, of_elastic, -apart, hunt_crossley);
  const vec pressing_damp = hunt_crossley ? choose(landing, damping.linear, damp) : damp;
  const vec lands = where(landing, fma_(stiff, p, -(damping.linear * apart)));
  return (centre_contact){.nx = where(on, nx),
                          .ny = where(on, ny),
                          .rho = where(on, rho),
                          .inv = inv,
                          .apart = where(on, apart * inv),
                          .normal = where(pressed, raw),
                          .over_rho = where(pressed, raw * inv),
                          .stiff = where(pushing, stiff),
                          .damp = where(pushing, pressing_damp),
                          .cross = where(pushing, pressing_damp * around * inv),
                          .beyond = where(pushing, fnma_(stiff, leave, lands)),
                          .slide = fnma_(splat(pulley->omega), rho, around),
                          .touching = touching,
                          .pressed = pressed,
                          .on = on};
}

INLINE void fill_centres(const filling *f, const law_constants *constants, const double *zs,
                         const bd_slot *slot, int i, vec_sums *sums, const int law,
                         const int general, const int states, const int hunt_crossley) {
  const bd_contact_pulley *pulley = f->pulley;
  const bd_layout *lay = &f->links->lay;
  const int friction = law != BD_LAW_NONE, stride = lay->stride;
  const vec none = splat(0.0), one = splat(1.0), omega = splat(pulley->omega), g = f->g;
  const centre_contact on = centre_contact_of(f->links, pulley, f->of->y,
                                              splat(f->of->c ? f->of->h : 0.0), i, hunt_crossley);
  const vec nx = on.nx, ny = on.ny, rho = on.rho;
  const vec out[2] = {nx, ny}, along[2] = {-ny, nx};
  vec nq[2], nv[2], sq[2], fq[2] = {none, none}, fv[2] = {none, none};
  for (int m = 0; m < 2; ++m) {
    nq[m] = -fma_(on.stiff, out[m], on.cross * along[m]);
    nv[m] = -(on.damp * out[m]);
    sq[m] = -fma_(on.apart, along[m], omega * out[m]);
  }
  law_at at = {.v = general ? where(on.touching, on.slide) : on.slide,
               .normal = on.normal,
               .touch = on.touching};
  double *const cz =
      f->of->c && states != 0 ? bd_field(lay, f->of->c, bd_f_state(lay, pulley->slot)) : NULL;
  vec force = none, by_normal = none, direct = none, by_slip = none;
  for (int e = 0; friction && e < law_elements(pulley, states); ++e) {
    const int k = e * stride + i;
    at.element = e;
    at.z = states != 0 ? load(zs + k) : none;
    const law_slopes slopes = law_slopes_of(constants, &at, law);
    by_normal += slopes.by_normal;
    if (general) {
      force += law_value_of(constants, &at, law).force;
      direct += slopes.by_slip;
    }
    if (states == 0) {
      continue;
    }
    const vec by_state = general ? where(on.touching, slopes.by_state) : on.normal;
    const vec gain = where(on.touching, slopes.rate_by_slip);
    const vec gain_normal = general ? where(on.touching, slopes.rate_by_normal) : none;
    const vec decay = one / fma_(g, where(on.touching, -slopes.rate_by_state), one);
    const vec change = g * decay, given = f->g2 * (by_state * decay);
    for (int m = 0; m < 2; ++m) {
      vec zq = gain * sq[m], zv = gain * along[m];
      if (general) {
        zq = fma_(gain_normal, nq[m], zq);
        zv = fma_(gain_normal, nv[m], zv);
      }
      zq *= change;
      zv *= change;
      store(slot->zq[m] + k, zq);
      store(slot->zv[m] + k, zv);
      fq[m] = fma_(by_state, zq, fq[m]);
      fv[m] = fma_(by_state, zv, fv[m]);
    }
    by_slip = fma_(by_state, change * gain, by_slip);
    store(slot->decay + k, decay);
    store(slot->spin + k, -(change * gain * rho));
    store(slot->given_x + k, given * ny);
    store(slot->given_y + k, -(given * nx));
    store(slot->given_torque + k, given * rho);
    if (general && cz) {
      add_to(cz, k, gain_normal * on.beyond);
    }
  }
  by_normal = where(on.touching, by_normal);
  direct = where(on.touching, direct);
  by_slip += direct;
  force = general ? where(on.pressed, force) : by_normal * on.normal;
  const vec over = force * on.inv;
  for (int m = 0; m < 2; ++m) {
    vec x = fnma_(on.over_rho * along[m], ny, nq[m] * nx);
    vec y = fma_(on.over_rho * along[m], nx, nq[m] * ny);
    vec vx = nv[m] * nx, vy = nv[m] * ny;
    if (friction) {
      vec mq = fma_(by_normal, nq[m], fq[m]), mv = fma_(by_normal, nv[m], fv[m]);
      if (general) {
        mq = fma_(direct, sq[m], mq);
        mv = fma_(direct, along[m], mv);
      }
      x = fma_(over * along[m], nx, fma_(mq, ny, x));
      y = fma_(over * along[m], ny, fnma_(mq, nx, y));
      vx = fma_(mv, ny, vx);
      vy = fnma_(mv, nx, vy);
      const vec torque = f->g2 * fma_(rho, mq, force * out[m]);
      store(f->body->q + m * stride + i, torque);
      store(f->body->w + m * stride + i, -fma_(g * rho, mv, torque));
      store(slot->sq[m] + i, g * sq[m]);
      store(slot->sv[m] + i, g * along[m]);
    }
    x *= f->g2;
    y *= f->g2;
    add_to(entry_of(f->blocks->q, 3, i, 1, m), 0, x);
    add_to(entry_of(f->blocks->q, 3, i, 1, 3 + m), 0, y);
    add_to(entry_of(f->blocks->w, 3, i, 1, m), 0, -fma_(g, vx, x));
    add_to(entry_of(f->blocks->w, 3, i, 1, 3 + m), 0, -fma_(g, vy, y));
  }
  if (f->of->c) {
    const vec drag = by_normal * on.beyond, inv_mass = splat(f->links->inv_mass);
    double *const c = bd_field(lay, f->of->c, F_VX);
    add_to(c, i, inv_mass * fma_(on.beyond, nx, drag * ny));
    add_to(c + stride, i, inv_mass * fnma_(drag, nx, on.beyond * ny));
    sums->torque = fma_(drag, rho, sums->torque);
  }
  if (friction) {
    const vec spin = g * by_slip * rho;
    store(slot->rho + i, -(g * rho));
    store(f->body->column + i, ny * spin);
    store(f->body->column + stride + i, -(nx * spin));
    sums->own = fma_(spin, rho, sums->own);
  }
}

INLINE bd_fill_sums fill_at_centres(const filling *f, int n_runs, const bd_run *runs,
                                    const bd_slot *slot, const int law, const int general,
                                    const int states) {
  const bd_layout *lay = &f->links->lay;
  const double *zs =
      states != 0 ? bd_cfield(lay, f->of->y, bd_f_state(lay, f->pulley->slot)) : NULL;
  const law_constants constants = law_prepare(&f->pulley->friction, f->pulley->l0, law);
  vec_sums sums = {splat(0.0), splat(0.0), splat(0.0), splat(0.0)};
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      if (f->pulley->hunt_crossley > 0.0) {
        fill_centres(f, &constants, zs, slot, i, &sums, law, general, states, 1);
      } else {
        fill_centres(f, &constants, zs, slot, i, &sums, law, general, states, 0);
      }
    }
  }
  return (bd_fill_sums){.own = sum(sums.own), .torque = sum(sums.torque)};
}
