/* SPDX-License-Identifier: MIT
 *
 * The linearised model, compiled once per instruction level: what linear.c needs of every link, in
 * loops over the blocks of the state's layout. linear.c has the derivation and the names.
 */

/* --- joints ---------------------------------------------------------------------------------- */

/* Keeps of the last evaluation what the joints' linearisation needs: later evaluations, at other
 * states, write over the links' scratch. */
static void keep_joints(const bd_links *links, const double *y, const bd_tangent *tangent) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double inv_half = 1.0 / links->half;
  const double *restrict co = ALIGNED(links->cos), *restrict si = ALIGNED(links->sin);
  const double *restrict fx = ALIGNED(links->fx), *restrict fy = ALIGNED(links->fy);
  const double *restrict w = ALIGNED(bd_cfield(lay, y, F_VPHI));
  double *restrict kc = ALIGNED(tangent->cos), *restrict ks = ALIGNED(tangent->sin);
  double *restrict kw = ALIGNED(tangent->spin), *restrict pull = ALIGNED(tangent->pull);
  SIMD for (int i = 0; i < n8; ++i) {
    kc[i] = co[i];
    ks[i] = si[i];
    kw[i] = w[i];
    pull[i] = inv_half * FMA(co[i], fx[i] + fx[i + 1], si[i] * (fy[i] + fy[i + 1]));
  }
  kc[-1] = kc[n - 1];
  ks[-1] = ks[n - 1];
  kw[-1] = kw[n - 1];
}

/* The diagonal blocks without contact. */
static void diagonal(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                     const bd_blocks *blocks) {
  const int n8 = links->lay.n8;
  const double straight = FMA(2.0, blocks->k, stage->mass);
  const double turning = stage->mass / 3.0 + 2.0 * (blocks->k + blocks->bend);
  const double g2 = stage->g * stage->g;
  const double *restrict pull = ALIGNED(tangent->pull);
  double *restrict xx = ALIGNED(blocks->xx), *restrict xy = ALIGNED(blocks->xy);
  double *restrict yx = ALIGNED(blocks->yx), *restrict yy = ALIGNED(blocks->yy);
  double *restrict pp = ALIGNED(blocks->pp);
  SIMD for (int i = 0; i < n8; ++i) {
    xx[i] = straight;
    xy[i] = 0.0;
    yx[i] = 0.0;
    yy[i] = straight;
    pp[i] = FMA(g2, pull[i], turning);
  }
}

/* r = M b_v + g F_q b_q of the joints, b = g c; positions' part of c has its halo set here. */
static void joints_product(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                           double *c, double *restrict x, double *restrict y, double *restrict p) {
  const bd_layout *lay = &links->lay;
  const int n = lay->n, n8 = lay->n8;
  const double g = stage->g, half = links->half, inv_half = 1.0 / half;
  const double mass = g / links->inv_mass, inertia = mass * half / 3.0;
  const double stiffness = g * g * links->stiffness, damping = g * g * links->damping;
  const double bend = g * g * links->bending * inv_half * inv_half;
  const double *restrict cx = ALIGNED(bd_cfield(lay, c, F_X));
  const double *restrict cy = ALIGNED(bd_cfield(lay, c, F_Y));
  double *restrict cp = ALIGNED(bd_field(lay, c, F_PHI));
  const double *restrict cvx = ALIGNED(bd_cfield(lay, c, F_VX));
  const double *restrict cvy = ALIGNED(bd_cfield(lay, c, F_VY));
  const double *restrict cvp = ALIGNED(bd_cfield(lay, c, F_VPHI));
  const double *restrict co = ALIGNED(tangent->cos), *restrict si = ALIGNED(tangent->sin);
  const double *restrict w = ALIGNED(tangent->spin), *restrict pull = ALIGNED(tangent->pull);
  double *restrict lx = ALIGNED(links->fx), *restrict ly = ALIGNED(links->fy);
  double *restrict rx = ALIGNED(links->rx), *restrict ry = ALIGNED(links->ry);
  x = ALIGNED(x);
  y = ALIGNED(y);
  p = ALIGNED(p);
  cp[-1] = cp[n - 1];
  cp[n] = cp[0];
  /* what each end of a link adds to the force of its joint */
  SIMD for (int i = 0; i < n8; ++i) {
    const double b = half * cp[i], turn = damping * w[i] * b, along = stiffness * b;
    const double ex = FMA(turn, co[i], along * si[i]), ey = FMA(turn, si[i], -(along * co[i]));
    const double sx = stiffness * cx[i], sy = stiffness * cy[i];
    lx[i] = sx + ex;
    ly[i] = sy + ey;
    rx[i] = sx - ex;
    ry[i] = sy - ey;
  }
  rx[-1] = rx[n - 1];
  ry[-1] = ry[n - 1];
  lx[n] = lx[0];
  ly[n] = ly[0];
  SIMD for (int i = 0; i < n8; ++i) {
    const double here_x = lx[i] - rx[i - 1], here_y = ly[i] - ry[i - 1];
    const double next_x = lx[i + 1] - rx[i], next_y = ly[i + 1] - ry[i];
    x[i] = FMA(mass, cvx[i], next_x - here_x);
    y[i] = FMA(mass, cvy[i], next_y - here_y);
    double turning = FMA(co[i], here_y + next_y, -(si[i] * (here_x + next_x)));
    turning = FMA(bend * half, (cp[i + 1] - cp[i]) - (cp[i] - cp[i - 1]), turning);
    p[i] = FMA(inertia, cvp[i], FMA(-g * g * pull[i] * half, cp[i], turning));
  }
}

/* From the links' velocities to all their unknowns, in place: c becomes the solution, but for
 * friction in contact, and 0 for the padding. */
static void finish_links(const bd_links *links, const bd_stage *stage, const double *restrict x,
                         const double *restrict y, const double *restrict p, double *c) {
  const bd_layout *lay = &links->lay;
  const int n8 = lay->n8;
  const double g = stage->g, inv_half = 1.0 / links->half;
  const double *restrict live = ALIGNED(links->live);
  double *restrict cx = ALIGNED(bd_field(lay, c, F_X)), *restrict cy =
                                                            ALIGNED(bd_field(lay, c, F_Y));
  double *restrict cp = ALIGNED(bd_field(lay, c, F_PHI));
  double *restrict cvx = ALIGNED(bd_field(lay, c, F_VX));
  double *restrict cvy = ALIGNED(bd_field(lay, c, F_VY));
  double *restrict cvp = ALIGNED(bd_field(lay, c, F_VPHI));
  x = ALIGNED(x);
  y = ALIGNED(y);
  p = ALIGNED(p);
  SIMD for (int i = 0; i < n8; ++i) {
    const double turning = live[i] * inv_half * p[i], vx = live[i] * x[i], vy = live[i] * y[i];
    cx[i] = live[i] * g * (cx[i] + vx);
    cy[i] = live[i] * g * (cy[i] + vy);
    cp[i] = live[i] * g * (cp[i] + turning);
    cvx[i] = vx;
    cvy[i] = vy;
    cvp[i] = turning;
  }
  for (int f = F_MU; f < F_MU + 2 * lay->slots; ++f) {
    double *restrict friction = ALIGNED(bd_field(lay, c, f));
    SIMD for (int i = 0; i < n8; ++i) {
      friction[i] *= live[i] * g;
    }
  }
}

/* --- contact --------------------------------------------------------------------------------- */

static void keep_contact(const bd_links *links, const bd_drum *drum, double name, int n_runs,
                         const bd_run *runs, const double *y, const bd_touch *touch, int friction,
                         double ahead) {
  const bd_layout *lay = &links->lay;
  const bd_drum d = *drum;
  const double *restrict x = ALIGNED(bd_cfield(lay, y, F_X));
  const double *restrict yy = ALIGNED(bd_cfield(lay, y, F_Y));
  const double *restrict vx = ALIGNED(bd_cfield(lay, y, F_VX));
  const double *restrict vy = ALIGNED(bd_cfield(lay, y, F_VY));
  const double *restrict mu = ALIGNED(bd_cfield(lay, y, friction ? F_MU + d.slot : F_X));
  const double *restrict live = ALIGNED(links->live);
  double *restrict owner = ALIGNED(touch->owner);
  double *restrict t_nx = ALIGNED(touch->nx), *restrict t_ny = ALIGNED(touch->ny);
  double *restrict t_rho = ALIGNED(touch->rho), *restrict t_normal = ALIGNED(touch->normal);
  double *restrict t_mu = ALIGNED(touch->mu), *restrict t_stiff = ALIGNED(touch->stiff);
  double *restrict t_damp = ALIGNED(touch->damp), *restrict t_cross = ALIGNED(touch->cross);
  double *restrict t_apart = ALIGNED(touch->apart), *restrict t_gain = ALIGNED(touch->gain);
  double *restrict t_decay = ALIGNED(touch->decay), *restrict t_ahead = ALIGNED(touch->ahead);
  const double sigma = friction ? d.sigma : 0.0, per_mu_k = friction ? 1.0 / d.mu_k : 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    SIMD for (int i = begin; i < end; ++i) {
      const double dx = x[i] - d.x, dy = yy[i] - d.y;
      const double rho = sqrt(FMA(dx, dx, dy * dy));
      const double inv = 1.0 / rho, nx = dx * inv, ny = dy * inv;
      const double p = live[i] * (d.radius - rho);
      const double ux = vx[i] - d.vx, uy = vy[i] - d.vy;
      const double apart = FMA(ux, nx, uy * ny), around = FMA(uy, nx, -(ux * ny));
      const double raw = FMA(FMA(d.quadratic, p, d.linear), p, -(d.damping * apart));
      /* a straight step leaves the rim by this much */
      const double way_on = ahead * around, leave = 0.5 * way_on * way_on * inv;
      const int touching = p > 0.0, pressed = touching & (raw > 0.0);
      const int landing = !touching & (live[i] > 0.0) & (p - ahead * apart > leave);
      const int on = touching | landing;
      const double stiff = landing ? d.linear : pressed ? FMA(2.0 * d.quadratic, p, d.linear) : 0.0;
      const double touched = landing ? FMA(d.linear, p, -(d.damping * apart)) : 0.0;
      const double slide = around - d.omega * rho;
      const double m = friction & touching ? mu[i] : 0.0, way = slide > 0.0   ? 1.0
                                                                : slide < 0.0 ? -1.0
                                                                              : 0.0;
      const double damp = pressed | landing ? d.damping : 0.0, rub = touching ? sigma : 0.0;
      owner[i] = on ? name : owner[i];
      t_nx[i] = on ? nx : t_nx[i];
      t_ny[i] = on ? ny : t_ny[i];
      t_rho[i] = on ? rho : t_rho[i];
      t_normal[i] = on ? (pressed ? raw : 0.0) : t_normal[i];
      t_mu[i] = on ? m : t_mu[i];
      t_stiff[i] = on ? stiff : t_stiff[i];
      t_damp[i] = on ? damp : t_damp[i];
      t_cross[i] = on ? damp * around * inv : t_cross[i];
      t_apart[i] = on ? apart * inv : t_apart[i];
      t_gain[i] = on ? rub * FMA(-way * m, per_mu_k, 1.0) : t_gain[i];
      t_decay[i] = on ? rub * per_mu_k * fabs(slide) : t_decay[i];
      t_ahead[i] = on ? FMA(-stiff, leave, touched) : t_ahead[i];
    }
  }
}

/* Adds to a rate what N will be beyond its tangent; returns its torque on the pulley. */
static double add_ahead(const bd_links *links, double name, int n_runs, const bd_run *runs,
                        const bd_touch *touch, double *c) {
  const bd_layout *lay = &links->lay;
  const double inv_mass = links->inv_mass;
  const double *restrict owner = ALIGNED(touch->owner), *restrict t_mu = ALIGNED(touch->mu);
  const double *restrict t_nx = ALIGNED(touch->nx), *restrict t_ny = ALIGNED(touch->ny);
  const double *restrict t_rho = ALIGNED(touch->rho), *restrict t_ahead = ALIGNED(touch->ahead);
  double *restrict cvx = ALIGNED(bd_field(lay, c, F_VX));
  double *restrict cvy = ALIGNED(bd_field(lay, c, F_VY));
  double torque = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : torque)") for (int i = begin; i < end; ++i) {
      const double more = owner[i] == name ? t_ahead[i] : 0.0, drag = t_mu[i] * more;
      cvx[i] = FMA(inv_mass, FMA(more, t_nx[i], drag * t_ny[i]), cvx[i]);
      cvy[i] = FMA(inv_mass, FMA(more, t_ny[i], -(drag * t_nx[i])), cvy[i]);
      torque = FMA(drag, t_rho[i], torque);
    }
  }
  return torque;
}

/* Adds one pulley's contact to the diagonal blocks, and sets its border; returns what the pulley's
 * own equation gets. */
static double add_contact(const bd_drum *drum, double name, int n_runs, const bd_run *runs,
                          const bd_touch *touch, double g, const bd_blocks *blocks) {
  const double omega = drum->omega;
  const double *restrict owner = ALIGNED(touch->owner);
  const double *restrict t_nx = ALIGNED(touch->nx), *restrict t_ny = ALIGNED(touch->ny);
  const double *restrict t_rho = ALIGNED(touch->rho), *restrict t_normal = ALIGNED(touch->normal);
  const double *restrict t_mu = ALIGNED(touch->mu), *restrict t_stiff = ALIGNED(touch->stiff);
  const double *restrict t_damp = ALIGNED(touch->damp), *restrict t_cross = ALIGNED(touch->cross);
  const double *restrict t_apart = ALIGNED(touch->apart), *restrict t_gain = ALIGNED(touch->gain);
  const double *restrict t_decay = ALIGNED(touch->decay);
  double *restrict xx = ALIGNED(blocks->xx), *restrict xy = ALIGNED(blocks->xy);
  double *restrict yx = ALIGNED(blocks->yx), *restrict yy = ALIGNED(blocks->yy);
  double *restrict column_x = ALIGNED(touch->column_x);
  double *restrict column_y = ALIGNED(touch->column_y);
  double *restrict row_x = ALIGNED(touch->row_x), *restrict row_y = ALIGNED(touch->row_y);
  double own = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : own)") for (int i = begin; i < end; ++i) {
      const double on = owner[i] == name ? 1.0 : 0.0;
      const double nx = t_nx[i], ny = t_ny[i], rho = t_rho[i], mu = t_mu[i];
      const double inv = 1.0 / rho, normal = g * g * on * t_normal[i];
      const double press = on * FMA(g * g, t_stiff[i], g * t_damp[i]);
      const double cross = g * g * on * t_cross[i];
      const double grip = normal * t_gain[i] / FMA(g, t_decay[i], 1.0);
      const double nt = FMA(-normal * mu, inv, cross);
      const double tn = -FMA(mu, press, grip * g * omega);
      const double tt = FMA(grip, FMA(-g, t_apart[i], 1.0), -FMA(mu, cross, normal * inv));
      const double both = nt + tn;
      xx[i] += FMA(nx * nx, press, FMA(ny * ny, tt, -(nx * ny * both)));
      yy[i] += FMA(ny * ny, press, FMA(nx * nx, tt, nx * ny * both));
      xy[i] += FMA(nx * ny, press - tt, FMA(nx * nx, nt, -(ny * ny * tn)));
      yx[i] += FMA(nx * ny, press - tt, FMA(nx * nx, tn, -(ny * ny * nt)));
      const double to_pulley_n = -FMA(rho, tn, normal * mu), to_pulley_t = -FMA(rho, tt, normal);
      const double from_pulley = -grip * rho;
      column_x[i] = -ny * from_pulley;
      column_y[i] = nx * from_pulley;
      row_x[i] = FMA(nx, to_pulley_n, -(ny * to_pulley_t));
      row_y[i] = FMA(ny, to_pulley_n, nx * to_pulley_t);
      own = FMA(grip * rho, rho, own);
    }
  }
  return own;
}

/* Adds one pulley's contact to g F_q b_q and g F_mu's part; returns the pulley's own. */
static double contact_product(const bd_layout *lay, const bd_drum *drum, double name, int n_runs,
                              const bd_run *runs, const bd_touch *touch, double g, int friction,
                              const double *c, double *restrict x, double *restrict y) {
  const double omega = drum->omega;
  const double *restrict owner = ALIGNED(touch->owner);
  const double *restrict t_nx = ALIGNED(touch->nx), *restrict t_ny = ALIGNED(touch->ny);
  const double *restrict t_rho = ALIGNED(touch->rho), *restrict t_normal = ALIGNED(touch->normal);
  const double *restrict t_mu = ALIGNED(touch->mu), *restrict t_stiff = ALIGNED(touch->stiff);
  const double *restrict t_cross = ALIGNED(touch->cross), *restrict t_apart = ALIGNED(touch->apart);
  const double *restrict t_gain = ALIGNED(touch->gain), *restrict t_decay = ALIGNED(touch->decay);
  const double *restrict cx = ALIGNED(bd_cfield(lay, c, F_X));
  const double *restrict cy = ALIGNED(bd_cfield(lay, c, F_Y));
  const double *restrict cmu = ALIGNED(bd_cfield(lay, c, friction ? F_MU + drum->slot : F_X));
  x = ALIGNED(x);
  y = ALIGNED(y);
  double torque = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    _Pragma("omp simd reduction(+ : torque)") for (int i = begin; i < end; ++i) {
      const double on = owner[i] == name ? g : 0.0;
      const double nx = t_nx[i], ny = t_ny[i], rho = t_rho[i], mu = t_mu[i];
      const double normal = t_normal[i];
      const double bn = g * FMA(nx, cx[i], ny * cy[i]), bt = g * FMA(nx, cy[i], -(ny * cx[i]));
      const double more = -FMA(t_stiff[i], bn, t_cross[i] * bt);
      const double slide = -FMA(t_apart[i], bt, omega * bn);
      const double rise =
          friction ? g * FMA(t_gain[i], slide, cmu[i]) / FMA(g, t_decay[i], 1.0) : 0.0;
      const double round = normal / rho * bt;
      const double along = on * FMA(mu, round, more);
      const double across = on * (round - FMA(mu, more, normal * rise));
      x[i] += FMA(nx, along, -(ny * across));
      y[i] += FMA(ny, along, nx * across);
      torque = FMA(on, FMA(mu, FMA(rho, more, normal * bn), normal * rho * rise), torque);
    }
  }
  return torque;
}

/* The friction unknowns of one pulley's contact; everything else of c is solved. */
static void finish_contact(const bd_layout *lay, const bd_drum *drum, double name, int n_runs,
                           const bd_run *runs, const bd_touch *touch, double g, double spin_up,
                           double *c) {
  const double omega = drum->omega;
  const double *restrict owner = ALIGNED(touch->owner);
  const double *restrict t_nx = ALIGNED(touch->nx), *restrict t_ny = ALIGNED(touch->ny);
  const double *restrict t_rho = ALIGNED(touch->rho), *restrict t_apart = ALIGNED(touch->apart);
  const double *restrict t_gain = ALIGNED(touch->gain), *restrict t_decay = ALIGNED(touch->decay);
  const double *restrict cx = ALIGNED(bd_cfield(lay, c, F_X));
  const double *restrict cy = ALIGNED(bd_cfield(lay, c, F_Y));
  const double *restrict cvx = ALIGNED(bd_cfield(lay, c, F_VX));
  const double *restrict cvy = ALIGNED(bd_cfield(lay, c, F_VY));
  double *restrict cmu = ALIGNED(bd_field(lay, c, F_MU + drum->slot));
  double *restrict cslip = ALIGNED(bd_field(lay, c, bd_f_slip(lay) + drum->slot));
  for (int r = 0; r < n_runs; ++r) {
    const int begin = runs[r].begin, end = runs[r].end;
    SIMD for (int i = begin; i < end; ++i) {
      const double on = owner[i] == name ? g : 0.0;
      const double nx = t_nx[i], ny = t_ny[i];
      const double qn = FMA(nx, cx[i], ny * cy[i]), qt = FMA(nx, cy[i], -(ny * cx[i]));
      const double vt = FMA(nx, cvy[i], -(ny * cvx[i]));
      const double slide = vt - FMA(t_apart[i], qt, FMA(omega, qn, t_rho[i] * spin_up));
      cmu[i] = FMA(on * t_gain[i], slide, cmu[i]) / FMA(on, t_decay[i], 1.0);
      cslip[i] = FMA(on, slide, cslip[i]);
    }
  }
}

/* --- border ---------------------------------------------------------------------------------- */

/* The column of one pulley. */
static void border_column(double name, int n_runs, const bd_run *runs, const bd_touch *touch,
                          double *restrict x, double *restrict y) {
  for (int r = 0; r < n_runs; ++r) {
    SIMD for (int i = runs[r].begin; i < runs[r].end; ++i) {
      x[i] = touch->owner[i] == name ? touch->column_x[i] : 0.0;
      y[i] = touch->owner[i] == name ? touch->column_y[i] : 0.0;
    }
  }
}

/* The row of one pulley times a vector. */
static double border_row(double name, int n_runs, const bd_run *runs, const bd_touch *touch,
                         const double *restrict x, const double *restrict y) {
  double sum = 0.0;
  for (int r = 0; r < n_runs; ++r) {
    _Pragma("omp simd reduction(+ : sum)") for (int i = runs[r].begin; i < runs[r].end; ++i) {
      const double part = FMA(touch->row_x[i], x[i], touch->row_y[i] * y[i]);
      sum += touch->owner[i] == name ? part : 0.0;
    }
  }
  return sum;
}

static void subtract(int n, double factor, const double *restrict z, double *restrict x) {
  z = ALIGNED(z);
  x = ALIGNED(x);
  SIMD for (int i = 0; i < n; ++i) {
    x[i] = FMA(-factor, z[i], x[i]);
  }
}

const bd_linear_kernels PASTE(bd_linear_, BD_LEVEL) = {
    .width = BD_WIDTH,
    .ring_row = sizeof(ring_row),
    .factor = ring_factor,
    .solve = ring_solve,
    .keep_joints = keep_joints,
    .diagonal = diagonal,
    .joints_product = joints_product,
    .finish_links = finish_links,
    .keep_contact = keep_contact,
    .add_ahead = add_ahead,
    .add_contact = add_contact,
    .contact_product = contact_product,
    .finish_contact = finish_contact,
    .border_column = border_column,
    .border_row = border_row,
    .subtract = subtract,
};
