/* SPDX-License-Identifier: MIT
 *
 * The linearised model, compiled once per instruction level: what newton_system.c needs of every
 * link, in loops over the blocks of the state's layout. newton_system.c has the derivation and the
 * names.
 */

/* Links at i ... of a block. */
SPECIALISED pack links_at(const double *block, int i) {
  return *(const pack *)(block + i);
}

SPECIALISED void set_links(double *block, int i, pack value) {
  *(pack *)(block + i) = value;
}

/* For every link what the one before it has, or the one after it; `last` and `next` are the links
 * before and after. */
SPECIALISED pack shifted_on(pack last, pack here) {
#if BD_WIDTH == 8
  return __builtin_shufflevector(last, here, 7, 8, 9, 10, 11, 12, 13, 14);
#elif BD_WIDTH == 4
  return __builtin_shufflevector(last, here, 3, 4, 5, 6);
#elif BD_WIDTH == 2
  return __builtin_shufflevector(last, here, 1, 2);
#else
  (void)here;
  return last;
#endif
}

SPECIALISED pack shifted_back(pack here, pack next) {
#if BD_WIDTH == 8
  return __builtin_shufflevector(here, next, 1, 2, 3, 4, 5, 6, 7, 8);
#elif BD_WIDTH == 4
  return __builtin_shufflevector(here, next, 1, 2, 3, 4);
#elif BD_WIDTH == 2
  return __builtin_shufflevector(here, next, 1, 2);
#else
  (void)here;
  return next;
#endif
}

/* --- joints ---------------------------------------------------------------------------------- */

/* Keeps of the last evaluation, at y, what the joints' linearisation needs: later evaluations, at
 * other states, write over the links' directions. */
static void linearise_joints(const bd_links *links, const double *y, const bd_tangent *tangent) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double half = links->half, inv_half = 1.0 / half;
  const double stiffness = links->stiffness, damping = links->damping;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict w = ALIGNED(bd_cfield(lay, y, F_VPHI));
  const double *restrict co = ALIGNED(links->cos), *restrict si = ALIGNED(links->sin);
  double *restrict lx = ALIGNED(links->fx), *restrict ly = ALIGNED(links->fy);
  double *restrict rx = ALIGNED(links->rx), *restrict ry = ALIGNED(links->ry);
  double *restrict kc = ALIGNED(tangent->cos), *restrict ks = ALIGNED(tangent->sin);
  double *restrict kw = ALIGNED(tangent->spin), *restrict pull = ALIGNED(tangent->pull);
  /* what each end of a link adds to the force of its joint */
  SIMD for (int i = 0; i < n8; ++i) {
    const double hc = half * co[i], hs = half * si[i];
    const double ex = stiffness * hc - damping * hs * w[i];
    const double ey = stiffness * hs + damping * hc * w[i];
    const double sx = FMA(stiffness, x[i], damping * vx[i]);
    const double sy = FMA(stiffness, yy[i], damping * vy[i]);
    lx[i] = sx - ex;
    ly[i] = sy - ey;
    rx[i] = sx + ex;
    ry[i] = sy + ey;
    kc[i] = co[i];
    ks[i] = si[i];
    kw[i] = w[i];
  }
  rx[-1] = rx[n - 1];
  ry[-1] = ry[n - 1];
  lx[n] = lx[0];
  ly[n] = ly[0];
  SIMD for (int i = 0; i < n8; ++i) {
    const double fx = (lx[i] - rx[i - 1]) + (lx[i + 1] - rx[i]);
    const double fy = (ly[i] - ry[i - 1]) + (ly[i + 1] - ry[i]);
    pull[i] = inv_half * FMA(co[i], fx, si[i] * fy);
  }
  kc[-1] = kc[n - 1];
  ks[-1] = ks[n - 1];
  kw[-1] = kw[n - 1];
}

/* The diagonal blocks without contact, and what turning a link moves its ends' forces by. */
static void diagonal(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                     const bd_blocks *blocks) {
  const int n8 = links->lay.n8;
  const double straight = FMA(2.0, blocks->k, stage->mass);
  const double turning = stage->mass / 3.0 + 2.0 * (blocks->k + blocks->bending);
  const double g2 = stage->g * stage->g;
  const double along = g2 * links->stiffness * links->half,
               across = g2 * links->damping * links->half;
  const double *restrict pull = ALIGNED(tangent->pull), *restrict w = ALIGNED(tangent->spin);
  const double *restrict co = ALIGNED(tangent->cos), *restrict si = ALIGNED(tangent->sin);
  double *restrict xx = ALIGNED(blocks->xx), *restrict xy = ALIGNED(blocks->xy);
  double *restrict yx = ALIGNED(blocks->yx), *restrict yy = ALIGNED(blocks->yy);
  double *restrict pp = ALIGNED(blocks->pp);
  double *restrict ex = ALIGNED(tangent->end_x), *restrict ey = ALIGNED(tangent->end_y);
  SIMD for (int i = 0; i < n8; ++i) {
    const double turn = across * w[i];
    xx[i] = straight;
    xy[i] = 0.0;
    yx[i] = 0.0;
    yy[i] = straight;
    pp[i] = FMA(g2, pull[i], turning);
    ex[i] = FMA(turn, co[i], along * si[i]);
    ey[i] = FMA(turn, si[i], -(along * co[i]));
  }
}

/* What both ends of links are worth to the force of a joint, one component. */
typedef struct end_forces {
  pack left, right;
} end_forces;

SPECIALISED end_forces ends_force(pack stiffness, pack move, pack turn) {
  end_forces out = {.left = stiffness * move + turn, .right = stiffness * move - turn};
  return out;
}

/* r = M b_v + g F_q b_q of the joints, b = g c, in one pass: joint i pulls with what the left end
 * of link i and the right end of the link before are worth, in the registers of two blocks. */
static void joints_product(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                           const double *c, double *x, double *y, double *p) {
  const bd_layout *lay = &links->lay;
  const bd_tangent t = *tangent;
  const int n = lay->n, n8 = lay->n8;
  const double g = stage->g, half = links->half;
  const pack mass = splat(g / links->inv_mass), inertia = splat(g / links->inv_mass * half / 3.0);
  const pack stiffness = splat(g * g * links->stiffness), back = splat(-g * g * half);
  const pack bend = splat(g * g * links->bending / half);
  const double *cx = bd_cfield(lay, c, F_X), *cvx = bd_cfield(lay, c, F_VX);
  const int stride = lay->stride;
  const double *cy = cx + stride, *cp = cy + stride;
  const pack turn = splat(cp[n - 1]);
  pack last[3] = {ends_force(stiffness, splat(cx[n - 1]), splat(t.end_x[n - 1]) * turn).right,
                  ends_force(stiffness, splat(cy[n - 1]), splat(t.end_y[n - 1]) * turn).right,
                  bend * turn};
  pack here[3] = {last[0], last[1], last[2]}, first[3] = {last[0], last[1], last[2]};
  for (int i = 0; i <= n8; i += BD_WIDTH) {
    pack next[3] = {first[0], first[1], first[2]};
    if (i < n8) {
      const pack angle = links_at(cp, i);
      const end_forces fx = ends_force(stiffness, links_at(cx, i), links_at(t.end_x, i) * angle);
      const end_forces fy = ends_force(stiffness, links_at(cy, i), links_at(t.end_y, i) * angle);
      const pack right[3] = {fx.right, fy.right, bend * angle};
      next[0] = fx.left - shifted_on(last[0], fx.right);
      next[1] = fy.left - shifted_on(last[1], fy.right);
      next[2] = right[2] - shifted_on(last[2], right[2]);
      for (int k = 0; k < 3; ++k) {
        double lane[BD_WIDTH];
        if (i == 0) {
          memcpy(lane, &next[k], sizeof lane);
          first[k] = splat(lane[0]);
        }
        if (i + BD_WIDTH > n) { /* after the last link comes the first */
          const pack link_mask = links_at(links->link_mask, i);
          next[k] = link_mask * next[k] + (1.0 - link_mask) * first[k];
        }
        last[k] = right[k];
      }
    }
    if (i > 0) {
      const int j = i - BD_WIDTH;
      pack ahead[3];
      for (int k = 0; k < 3; ++k) {
        ahead[k] = shifted_back(here[k], next[k]);
      }
      set_links(x, j, mass * links_at(cvx, j) + (ahead[0] - here[0]));
      set_links(y, j, mass * links_at(cvx + stride, j) + (ahead[1] - here[1]));
      pack turning = ahead[2] - here[2];
      turning += links_at(t.cos, j) * (here[1] + ahead[1]);
      turning -= links_at(t.sin, j) * (here[0] + ahead[0]);
      turning += back * links_at(t.pull, j) * links_at(cp, j);
      set_links(p, j, inertia * links_at(cvx + 2 * stride, j) + turning);
    }
    for (int k = 0; k < 3; ++k) {
      here[k] = next[k];
    }
  }
}

/* From the links' velocities without the pulleys' to all their unknowns, in place: c becomes the
 * solution, but for friction in contact, and 0 for the padding. Pulley j's column, times its
 * acceleration, is `pitch` after that before it. */
static void finish_links(const bd_links *links, const bd_stage *stage, int n_columns,
                         const double *columns, const double *factors, const double *x,
                         const double *y, const double *p, double *c) {
  const bd_layout *lay = &links->lay;
  const int n8 = lay->n8, stride = lay->stride;
  const pack g = splat(stage->g), inv_half = splat(1.0 / links->half);
  double *cx = bd_field(lay, c, F_X), *cvx = bd_field(lay, c, F_VX);
  for (int i = 0; i < n8; i += BD_WIDTH) {
    pack v[3] = {links_at(x, i), links_at(y, i), links_at(p, i)};
    for (int j = 0; j < n_columns; ++j) {
      const double *column = columns + (size_t)(3 * j) * (size_t)stride;
      const pack factor = splat(factors[j]);
      for (int k = 0; k < 3; ++k) {
        v[k] -= factor * links_at(column + (size_t)k * (size_t)stride, i);
      }
    }
    const pack link_mask = links_at(links->link_mask, i);
    v[2] *= inv_half;
    for (int k = 0; k < 3; ++k) {
      const int at = k * stride + i;
      v[k] *= link_mask;
      set_links(cx, at, link_mask * g * links_at(cx, at) + g * v[k]);
      set_links(cvx, at, v[k]);
    }
    for (int k = 0; k < 2 * lay->slots; ++k) {
      const int at = (F_MU + k) * stride + i;
      set_links(cx, at, link_mask * g * links_at(cx, at));
    }
  }
}

/* --- contact --------------------------------------------------------------------------------- */

static void linearise_contact(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                              const bd_run *runs, const double *y,
                              const bd_contact_tangent *contact, int friction, double h) {
  const bd_layout *lay = &links->lay;
  const bd_contact_pulley d = *pulley;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict mu = ALIGNED(bd_cfield(lay, y, friction ? F_MU + d.slot : F_X));
  const double *restrict link_mask = ALIGNED(links->link_mask);
  double *restrict t_nx = ALIGNED(contact->nx), *restrict t_ny = ALIGNED(contact->ny);
  double *restrict t_rho = ALIGNED(contact->rho), *restrict t_normal_over_rho =
                                                      ALIGNED(contact->normal_over_rho);
  double *restrict t_normal = ALIGNED(contact->normal), *restrict t_mu = ALIGNED(contact->mu);
  double *restrict t_stiff = ALIGNED(contact->stiff), *restrict t_damp = ALIGNED(contact->damp);
  double *restrict t_cross = ALIGNED(contact->cross), *restrict t_apart = ALIGNED(contact->apart);
  double *restrict t_gain = ALIGNED(contact->gain), *restrict t_decay = ALIGNED(contact->decay);
  double *restrict t_normal_correction = ALIGNED(contact->normal_correction);
  const double sigma = friction ? d.sigma : 0.0, per_mu_k = friction ? 1.0 / d.mu_k : 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    SIMD for (int i = begin; i < end; ++i) {
      const double dx = x[i] - d.x, dy = yy[i] - d.y;
      const double rho = sqrt(FMA(dx, dx, dy * dy));
      const double inv = 1.0 / rho, nx = dx * inv, ny = dy * inv;
      const double p = link_mask[i] * (d.radius - rho);
      const double ux = vx[i] - d.vx, uy = vy[i] - d.vy;
      const double apart = FMA(ux, nx, uy * ny), around = FMA(uy, nx, -(ux * ny));
      const double raw = FMA(FMA(d.quadratic, p, d.linear), p, -(d.damping * apart));
      /* a straight step leaves the rim by this much */
      const double arc_travel = h * around, leave = 0.5 * arc_travel * arc_travel * inv;
      const int touching = p > 0.0, pressed = touching & (raw > 0.0);
      const int landing = !touching & (link_mask[i] > 0.0) & (p - h * apart > leave);
      const int on = touching | landing, pushing = pressed | landing;
      const double slide = around - d.omega * rho;
      const double m = friction ? mu[i] : 0.0, slip_sign = slide > 0.0   ? 1.0
                                                           : slide < 0.0 ? -1.0
                                                                         : 0.0;
      const double normal_over_rho = raw * inv, deep = FMA(2.0 * d.quadratic, p, d.linear);
      const double stiff = landing ? d.linear : deep,
                   lands = FMA(d.linear, p, -(d.damping * apart));
      const double cross = d.damping * around * inv, away = apart * inv;
      const double gain = sigma * FMA(-slip_sign * m, per_mu_k, 1.0);
      const double decay = sigma * per_mu_k * fabs(slide);
      const double normal_correction = FMA(-stiff, leave, landing ? lands : 0.0);
      t_nx[i] = on ? nx : 0.0;
      t_ny[i] = on ? ny : 0.0;
      t_rho[i] = on ? rho : 0.0;
      t_normal_over_rho[i] = pressed ? normal_over_rho : 0.0;
      t_normal[i] = pressed ? raw : 0.0;
      t_mu[i] = touching ? m : 0.0;
      t_stiff[i] = pushing ? stiff : 0.0;
      t_damp[i] = pushing ? d.damping : 0.0;
      t_cross[i] = pushing ? cross : 0.0;
      t_apart[i] = on ? away : 0.0;
      t_gain[i] = touching ? gain : 0.0;
      t_decay[i] = touching ? decay : 0.0;
      t_normal_correction[i] = pushing ? normal_correction : 0.0;
    }
  }
}

/* Adds to a rate what N will be normal_correction its tangent; returns its torque on the pulley. */
static double add_normal_correction(const bd_links *links, int n_runs, const bd_run *runs,
                                    const bd_contact_tangent *contact, double *c) {
  const bd_layout *lay = &links->lay;
  const double inv_mass = links->inv_mass;
  const double *restrict t_nx = ALIGNED(contact->nx), *restrict t_ny = ALIGNED(contact->ny);
  const double *restrict t_rho = ALIGNED(contact->rho), *restrict t_mu = ALIGNED(contact->mu);
  const double *restrict t_normal_correction = ALIGNED(contact->normal_correction);
  double *restrict cvx = ALIGNED(bd_field(lay, c, F_VX));
  double *restrict cvy = ALIGNED(bd_field(lay, c, F_VY));
  double torque = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : torque)") for (int i = begin; i < end; ++i) {
      const double more = t_normal_correction[i], drag = t_mu[i] * more;
      cvx[i] = FMA(inv_mass, FMA(more, t_nx[i], drag * t_ny[i]), cvx[i]);
      cvy[i] = FMA(inv_mass, FMA(more, t_ny[i], -(drag * t_nx[i])), cvy[i]);
      torque = FMA(drag, t_rho[i], torque);
    }
  }
  return torque;
}

/* A 2 x 2 block from the axes (n, t) of a link to those of the plane. */
#define TURN_BACK(nn, nt, tn, tt, XX, XY, YX, YY)                                                  \
  do {                                                                                             \
    const double nn_tt = nx * ny * ((nn) - (tt)), both = nx * ny * ((nt) + (tn));                  \
    XX = FMA(nx * nx, nn, FMA(ny * ny, tt, -both));                                                \
    XY = FMA(nx * nx, nt, FMA(-ny * ny, tn, nn_tt));                                               \
    YX = FMA(nx * nx, tn, FMA(-ny * ny, nt, nn_tt));                                               \
    YY = FMA(ny * ny, nn, FMA(nx * nx, tt, both));                                                 \
  } while (0)

/* Adds one pulley's contact to the diagonal blocks, sets its border and what solves need for g;
 * returns what the pulley's own equation gets. */
static double add_contact(const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                          const bd_contact_tangent *contact, double g, const bd_blocks *blocks,
                          double *restrict column_x, double *restrict column_y) {
  const double omega = pulley->omega, g2 = g * g;
  const double *restrict t_nx = ALIGNED(contact->nx), *restrict t_ny = ALIGNED(contact->ny);
  const double *restrict t_rho = ALIGNED(contact->rho), *restrict t_normal_over_rho =
                                                            ALIGNED(contact->normal_over_rho);
  const double *restrict t_normal = ALIGNED(contact->normal), *restrict t_mu = ALIGNED(contact->mu);
  const double *restrict t_stiff = ALIGNED(contact->stiff), *restrict t_damp =
                                                                ALIGNED(contact->damp);
  const double *restrict t_cross = ALIGNED(contact->cross), *restrict t_apart =
                                                                ALIGNED(contact->apart);
  const double *restrict t_gain = ALIGNED(contact->gain), *restrict t_decay =
                                                              ALIGNED(contact->decay);
  double *restrict b_xx = ALIGNED(blocks->xx), *restrict b_xy = ALIGNED(blocks->xy);
  double *restrict b_yx = ALIGNED(blocks->yx), *restrict b_yy = ALIGNED(blocks->yy);
  double *restrict row_x = ALIGNED(contact->row_x), *restrict row_y = ALIGNED(contact->row_y);
  double *restrict f_xx = ALIGNED(contact->xx), *restrict f_xy = ALIGNED(contact->xy);
  double *restrict f_yx = ALIGNED(contact->yx), *restrict f_yy = ALIGNED(contact->yy);
  double *restrict f_mu = ALIGNED(contact->by_mu);
  double *restrict torque_x = ALIGNED(contact->torque_x);
  double *restrict torque_y = ALIGNED(contact->torque_y);
  double *restrict slide_x = ALIGNED(contact->slide_x), *restrict slide_y =
                                                            ALIGNED(contact->slide_y);
  double *restrict f_dmu_dslip = ALIGNED(contact->dmu_dslip), *restrict f_mu_decay_factor =
                                                                  ALIGNED(contact->mu_decay_factor);
  column_x = ALIGNED(column_x);
  column_y = ALIGNED(column_y);
  double own = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : own)") for (int i = begin; i < end; ++i) {
      const double nx = t_nx[i], ny = t_ny[i], rho = t_rho[i], mu = t_mu[i], apart = t_apart[i];
      const double mu_decay_factor = 1.0 / FMA(g, t_decay[i], 1.0),
                   dmu_dslip = g * t_gain[i] * mu_decay_factor;
      const double normal = g2 * t_normal[i], normal_over_rho = g2 * t_normal_over_rho[i],
                   cross = g2 * t_cross[i];
      const double stiff = g2 * t_stiff[i], press = FMA(g, t_damp[i], stiff);
      const double friction_tangent = t_normal[i] * g * dmu_dslip; /* of dv_T */
      double xx, xy, yx, yy;
      /* by velocities */
      const double nt = FMA(-normal_over_rho, mu, cross),
                   tn = -FMA(mu, press, friction_tangent * g * omega);
      const double tt =
          FMA(friction_tangent, FMA(-g, apart, 1.0), -FMA(mu, cross, normal_over_rho));
      TURN_BACK(press, nt, tn, tt, xx, xy, yx, yy);
      b_xx[i] += xx;
      b_xy[i] += xy;
      b_yx[i] += yx;
      b_yy[i] += yy;
      const double to_pulley_n = -FMA(rho, tn, normal * mu), to_pulley_t = -FMA(rho, tt, normal);
      row_x[i] = FMA(nx, to_pulley_n, -(ny * to_pulley_t));
      row_y[i] = FMA(ny, to_pulley_n, nx * to_pulley_t);
      column_x[i] = ny * friction_tangent * rho;
      column_y[i] = -nx * friction_tangent * rho;
      own = FMA(friction_tangent * rho, rho, own);
      /* by what a solve is given for positions and friction */
      const double given_tn = FMA(mu, stiff, friction_tangent * g * omega);
      const double given_tt = FMA(mu, cross, FMA(friction_tangent, g * apart, normal_over_rho));
      const double torque_n = FMA(-rho, given_tn, normal * mu);
      const double torque_t = FMA(-rho, given_tt, normal);
      TURN_BACK(-stiff, -nt, given_tn, given_tt, xx, xy, yx, yy);
      f_xx[i] = xx;
      f_xy[i] = xy;
      f_yx[i] = yx;
      f_yy[i] = yy;
      f_mu[i] = normal * mu_decay_factor;
      torque_x[i] = FMA(nx, torque_n, -(ny * torque_t));
      torque_y[i] = FMA(ny, torque_n, nx * torque_t);
      slide_x[i] = FMA(ny, apart, -(nx * omega));
      slide_y[i] = -FMA(nx, apart, ny * omega);
      f_dmu_dslip[i] = dmu_dslip;
      f_mu_decay_factor[i] = mu_decay_factor;
    }
  }
  return own;
}
#undef TURN_BACK

/* Sum of the lanes. */
SPECIALISED double total(pack sum) {
  double lane[BD_WIDTH];
  for (int k = BD_WIDTH / 2; k > 0; k /= 2) {
    sum += from_after(sum, k);
  }
  memcpy(lane, &sum, sizeof lane);
  return lane[0];
}

/* Adds one pulley's contact to g F_q b_q and g F_mu's part; returns the pulley's own. */
static double contact_product(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                              const bd_run *runs, const bd_contact_tangent *contact, int friction,
                              const double *c, double *x, double *y) {
  const bd_contact_tangent t = *contact;
  const double *cx = bd_cfield(lay, c, F_X), *cy = bd_cfield(lay, c, F_Y);
  const double *cmu = friction ? bd_cfield(lay, c, F_MU + pulley->slot) : NULL;
  pack torque = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += BD_WIDTH) {
      const pack bx = links_at(cx, i), by = links_at(cy, i);
      pack fx = links_at(x, i), fy = links_at(y, i);
      fx += links_at(t.xx, i) * bx;
      fx += links_at(t.xy, i) * by;
      fy += links_at(t.yx, i) * bx;
      fy += links_at(t.yy, i) * by;
      torque += links_at(t.torque_x, i) * bx;
      torque += links_at(t.torque_y, i) * by;
      if (friction) {
        const pack less = links_at(t.by_mu, i) * links_at(cmu, i);
        fx += links_at(t.ny, i) * less;
        fy -= links_at(t.nx, i) * less;
        torque += links_at(t.rho, i) * less;
      }
      set_links(x, i, fx);
      set_links(y, i, fy);
    }
  }
  return total(torque);
}

/* The friction unknowns of one pulley's contact; everything else of c is solved. */
static void finish_contact(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                           const bd_run *runs, const bd_contact_tangent *contact, double g,
                           double angular_acceleration, double *c) {
  const bd_contact_tangent t = *contact;
  const double *cx = bd_cfield(lay, c, F_X), *cy = bd_cfield(lay, c, F_Y);
  const double *cvx = bd_cfield(lay, c, F_VX), *cvy = bd_cfield(lay, c, F_VY);
  double *cmu = bd_field(lay, c, F_MU + pulley->slot);
  double *cslip = bd_field(lay, c, bd_f_slip(lay) + pulley->slot);
  const pack spin = splat(angular_acceleration), step = splat(g);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += BD_WIDTH) {
      pack slide = links_at(t.slide_x, i) * links_at(cx, i);
      slide += links_at(t.slide_y, i) * links_at(cy, i);
      slide += links_at(t.nx, i) * links_at(cvy, i);
      slide -= links_at(t.ny, i) * links_at(cvx, i);
      slide -= links_at(t.rho, i) * spin;
      const pack kept = links_at(t.mu_decay_factor, i) * links_at(cmu, i);
      set_links(cmu, i, kept + links_at(t.dmu_dslip, i) * slide);
      set_links(cslip, i, links_at(cslip, i) + step * slide);
    }
  }
}

/* The row of one pulley times a vector. */
static double border_row(int n_runs, const bd_run *runs, const bd_contact_tangent *contact,
                         const double *x, const double *y) {
  const bd_contact_tangent t = *contact;
  pack along_x = splat(0.0), along_y = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += BD_WIDTH) {
      along_x += links_at(t.row_x, i) * links_at(x, i);
      along_y += links_at(t.row_y, i) * links_at(y, i);
    }
  }
  return total(along_x + along_y);
}

const bd_newton_kernels PASTE(bd_newton_, BD_LEVEL) = {
    .width = BD_WIDTH,
    .ring_row = sizeof(ring_row),
    .ring_ends = sizeof(ring_ends),
    .factor = ring_factor,
    .solve = ring_solve,
    .linearise_joints = linearise_joints,
    .diagonal = diagonal,
    .joints_product = joints_product,
    .finish_links = finish_links,
    .linearise_contact = linearise_contact,
    .add_normal_correction = add_normal_correction,
    .add_contact = add_contact,
    .contact_product = contact_product,
    .finish_contact = finish_contact,
    .border_row = border_row,
};
