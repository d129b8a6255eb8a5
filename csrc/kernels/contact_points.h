/* SPDX-License-Identifier: MIT
 *
 * Contact along the links in the linear systems: friction at the points, and what points are worth
 * to nodes; link_contact_tangent.h says how. Compiled once per instruction level, in jacobian.h.
 */
/* --- points ---------------------------------------------------------------------------------- */

/* What stands with points: rows of the pulley by their six columns, forces by them (x, y of each);
 * column of the pulley, force of friction, what it will be beyond its tangent; rows of the mount,
 * and its column and that of its given travel, likewise. */
enum {
  ROW_Q = 0,
  ROW_W = 6,
  POINT_Q = 12,
  POINT_W = 24,
  COLUMN = 36,
  FORCE = 38,
  MORE = 40,
  OF_MOUNT = 42,
  AXIS_Q = OF_MOUNT,
  AXIS_W = 48,
  AXIS_COLUMN = 54
};

enum { BY_Q, BY_V, SHARE, SHARE_RATE }; /* kinds of rows of ends */

/* What stands with the ends that meet at points, by the points' columns. */
INLINE vec of_ends(const bd_contact_scratch *s, int i, const int kind, const int m,
                   const int belt) {
  const int columns = columns_of(belt), first = 6 - columns; /* of the segment behind the point */
  const int at = kind * columns + m;
  if (m < first) {
    return load_unaligned(s->end[1][at] + i - 1);
  }
  const vec behind = load(s->end[0][at - first] + i);
  return m < columns ? load_unaligned(s->end[1][at] + i - 1) + behind : behind;
}

/* Moves of points by their columns, along the normal and along the pulley; and the rate of the
 * latter by positions that links which turn add. */
typedef struct point_moves {
  vec out[6], along[6], turned[6];
} point_moves;

INLINE point_moves moves_of(const bd_tangent *tangent, vec nx, vec ny, int i, const int belt) {
  point_moves p;
  for (int m = 0; m < 6; ++m) {
    p.out[m] = p.along[m] = p.turned[m] = splat(0.0);
  }
  if (belt == STRING) {
    p.out[2] = p.along[3] = nx;
    p.out[3] = ny;
    p.along[2] = -ny;
    return p;
  }
  const vec half = splat(0.5), hx = half * nx, hy = half * ny;
  for (int side = 0; side < 2; ++side) {
    const int at = i - 1 + side, m = 3 * side;
    const vec c = load_unaligned(tangent->cos + at), s = load_unaligned(tangent->sin + at);
    const vec w = load_unaligned(tangent->spin + at);
    const vec x = side == 0 ? -s : s, y = side == 0 ? c : -c;
    const vec vx = side == 0 ? -(w * c) : w * c, vy = side == 0 ? -(w * s) : w * s;
    p.out[m] = p.along[m + 1] = hx;
    p.out[m + 1] = hy;
    p.along[m] = -hy;
    p.out[m + 2] = fma_(hx, x, hy * y);
    p.along[m + 2] = fnma_(hy, x, hx * y);
    p.turned[m + 2] = fnma_(hy, vx, hx * vy);
  }
  return p;
}

/* A state of friction within the step of g: by slip, and its rows by the point's columns beside
 * that, into the slot; what they do to the force is added to *by_slip, fq and fv. */
INLINE void eliminate_state(const filling *f, const bd_slot *slot, const law_at *at,
                            const law_slopes *slopes, const joint_contact *joint, vec share, vec nx,
                            vec ny, vec rho, int k, int i, vec *fq, vec *fv, vec *by_slip,
                            const int general, const int belt) {
  const vec none = splat(0.0), one = splat(1.0);
  const vec by_state = where(joint->touch, share * slopes->by_state);
  const vec gain = where(joint->touch, slopes->rate_by_slip);
  const vec decay_rate = where(joint->touch, joint->fresh - slopes->rate_by_state);
  const vec decay = one / fma_(f->g, decay_rate, one), change = f->g * decay;
  const vec gain_normal =
      general ? where(joint->touch, slopes->rate_by_normal * joint->inv_share) : none;
  const mask coming = less(none, joint->fresh);
  const vec per_share = where(coming, at->z / (joint->share + splat(FRESH)));
  const vec gain_share = fnma_(gain_normal, at->normal, joint->fresh * per_share);
  const int others = general || any(coming);
  for (int m = 0; others && m < 6; ++m) {
    vec zq = general ? gain_normal * of_ends(f->scratch, i, BY_Q, m, belt) : none;
    vec zv = general ? gain_normal * of_ends(f->scratch, i, BY_V, m, belt) : none;
    {
      const vec by = of_ends(f->scratch, i, SHARE, m, belt);
      zq = fma_(gain_share, by, zq);
      zq = fnma_(per_share, of_ends(f->scratch, i, SHARE_RATE, m, belt), zq);
      zv = fnma_(per_share, by, zv);
    }
    zq *= change;
    zv *= change;
    store(slot->zq[m] + k, is_angle(m, belt) ? f->arm * zq : zq);
    store(slot->zv[m] + k, is_angle(m, belt) ? f->arm * zv : zv);
    fq[m] = fma_(by_state, zq, fq[m]);
    fv[m] = fma_(by_state, zv, fv[m]);
  }
  *by_slip = fma_(by_state, change * gain, *by_slip);
  store(slot->others + k, splat(others ? 1.0 : 0.0));
  const vec given = f->g2 * (by_state * decay);
  store(slot->decay + k, decay);
  store(slot->by_slip + k, decay * gain);
  store(slot->given_x + k, given * ny);
  store(slot->given_y + k, -(given * nx));
  store(slot->given_torque + k, given * rho);
  if (general && f->of->c) {
    const vec more =
        load(f->scratch->correction[0] + i) + load_unaligned(f->scratch->correction[1] + i - 1);
    double *const cz =
        bd_field(&f->links->lay, f->of->c, bd_f_state(&f->links->lay, f->pulley->slot));
    add_to(cz, k, gain_normal * more);
  }
}

/* A mount's rows, and its columns at the points, of the force that column m makes, by positions and
 * by velocities. */
INLINE void fill_axis(const filling *f, const int m, vec qx, vec qy, vec vx, vec vy, int i,
                      vec *column, vec *given, const int belt) {
  const vec ax = splat(f->axis->a[0]), ay = splat(f->axis->a[1]);
  const vec q = fma_(ax, qx, ay * qy), v = fma_(ax, vx, ay * vy);
  const int axis = belt == STRING ? m % 2 : m % 3;
  store(f->scratch->point[AXIS_Q + m] + i, is_angle(m, belt) ? -(f->arm * q) : -q);
  store(f->scratch->point[AXIS_W + m] + i, q + v);
  if (!is_angle(m, belt)) {
    against_axis(f->axis, axis, qx, vx, &column[0], &given[0]);
    against_axis(f->axis, axis, qy, vy, &column[1], &given[1]);
  }
}

/* What the step does to forces at points beyond their tangent. */
INLINE void correct_points(const filling *f, vec nx, vec ny, vec rho, vec by_normal, int i,
                           vec_sums *sums, const int belt) {
  const vec more =
      load(f->scratch->correction[0] + i) + load_unaligned(f->scratch->correction[1] + i - 1);
  const vec drag = by_normal * more;
  vec x = drag * ny, y = -(drag * nx);
  if (belt == STRING) {
    x = fma_(more, nx, x);
    y = fma_(more, ny, y);
    accelerate(f->links, f->of->c, i, (link_force){.x = x, .y = y}, belt);
  } else {
    store(f->scratch->point[MORE] + i, x);
    store(f->scratch->point[MORE + 1] + i, y);
  }
  sums->x += x;
  sums->y += y;
  sums->torque = fma_(drag, rho, sums->torque);
}

/* Points: friction, and on a string the normal forces as well. */
INLINE void fill_point_friction(const filling *f, const law_constants *constants,
                                const joint_points *from, const double *zs, const bd_slot *slot,
                                int i, vec_sums *sums, const int belt, const int law,
                                const int general, const int states) {
  const bd_contact_pulley *pulley = f->pulley;
  const bd_contact_scratch *s = f->scratch;
  const int friction = law != BD_LAW_NONE, stride = f->links->lay.stride;
  const vec none = splat(0.0), one = splat(1.0), omega = splat(pulley->omega), g = f->g;
  const joint_contact joint = joint_contact_of(f->links, &s->pressure, i);
  const vec dx = load(from->x + i) - splat(pulley->x), dy = load(from->y + i) - splat(pulley->y);
  const vec ux = load(from->vx + i) - splat(pulley->vx);
  const vec uy = load(from->vy + i) - splat(pulley->vy);
  vec rho, inv;
  root_and_inverse(fma_(dx, dx, dy * dy), &rho, &inv);
  /* the normal forces of a string act where friction does not yet: links that land */
  inv = where(belt == STRING ? less(none, load(f->links->link_mask + i)) : joint.touch, inv);
  const vec nx = dx * inv, ny = dy * inv, lever = where(joint.touch, rho);
  const vec apart = fma_(ux, nx, uy * ny) * inv, share = general ? joint.share : one;
  law_at at = {.v = where(joint.touch, fnma_(omega, rho, fnma_(ux, ny, uy * nx))),
               .normal = general ? joint.normal * joint.inv_share : joint.normal,
               .touch = joint.touch};
  const point_moves move = moves_of(f->tangent, nx, ny, i, belt);
  vec sq[6], fq[6], fv[6];
  for (int m = 0; m < 6; ++m) {
    sq[m] = fq[m] = fv[m] = none;
    if (moves_point(m, belt)) {
      sq[m] = -fma_(apart, move.along[m], omega * move.out[m]);
      sq[m] = is_angle(m, belt) ? sq[m] + move.turned[m] : sq[m];
    }
  }
  vec value = none, by_normal = none, direct = none, by_slip = none;
  for (int e = 0; friction && e < law_elements(pulley, states); ++e) {
    at.element = e;
    at.z = states != 0 ? load(zs + e * stride + i) : none;
    const law_slopes slopes = law_slopes_of(constants, &at, law);
    value += law_value_of(constants, &at, law).force;
    by_normal += slopes.by_normal;
    direct += slopes.by_slip;
    if (states != 0) {
      eliminate_state(f, slot, &at, &slopes, &joint, share, nx, ny, lever, e * stride + i, i, fq,
                      fv, &by_slip, general, belt);
    }
  }
  const vec force = where(joint.touch, share * value), over = force * inv;
  const vec by_share = general ? where(joint.touch, fnma_(by_normal, at.normal, value)) : none;
  by_normal = where(joint.touch, by_normal);
  by_slip += where(joint.touch, share * direct);
  const vec pressed = joint.normal * inv;                /* N / rho */
  vec column[2] = {none, none}, given[2] = {none, none}; /* of a mount */
  for (int m = 0; m < 6; ++m) {
    const int own = moves_point(m, belt);
    vec more_q = none, more_v = none, x = none, y = none, vx = none, vy = none;
    if (friction || belt == STRING) {
      more_q = of_ends(s, i, BY_Q, m, belt);
      more_v = of_ends(s, i, BY_V, m, belt);
    }
    if (belt == STRING) {
      x = more_q * nx;
      y = more_q * ny;
      vx = more_v * nx;
      vy = more_v * ny;
      if (own) {
        x = fnma_(pressed * move.along[m], ny, x);
        y = fma_(pressed * move.along[m], nx, y);
      }
    }
    if (friction) {
      vec mq = fma_(by_normal, more_q, fq[m]), mv = fma_(by_normal, more_v, fv[m]);
      vec torque = none;
      mq = general ? fma_(by_share, of_ends(s, i, SHARE, m, belt), mq) : mq;
      if (own) {
        const vec along = over * move.along[m];
        mq = fma_(by_slip, sq[m], mq);
        mv = fma_(by_slip, move.along[m], mv);
        x = fma_(along, nx, x);
        y = fma_(along, ny, y);
        torque = force * move.out[m];
        const vec scale = is_angle(m, belt) ? g * f->arm : g;
        store(slot->sq[m] + i, where(joint.touch, scale * sq[m]));
        store(slot->sv[m] + i, where(joint.touch, scale * move.along[m]));
      }
      x = fma_(mq, ny, x);
      y = fnma_(mq, nx, y);
      vx = fma_(mv, ny, vx);
      vy = fnma_(mv, nx, vy);
      const vec q = f->g2 * fma_(rho, mq, torque), v = g * (rho * mv);
      store(s->point[ROW_Q + m] + i, is_angle(m, belt) ? f->arm * q : q);
      store(s->point[ROW_W + m] + i, -(q + v));
    }
    const vec qx = f->g2 * x, qy = f->g2 * y, wx = fma_(g, vx, qx), wy = fma_(g, vy, qy);
    if (belt == STRING) {
      const int place = m / 2, k = m % 2;
      add_to(entry_of(f->blocks->q.tiles, 2, i, place, k), 0, qx);
      add_to(entry_of(f->blocks->q.tiles, 2, i, place, 2 + k), 0, qy);
      add_to(entry_of(f->blocks->w.tiles, 2, i, place, k), 0, -wx);
      add_to(entry_of(f->blocks->w.tiles, 2, i, place, 2 + k), 0, -wy);
    } else {
      store(s->point[POINT_Q + 2 * m] + i, qx);
      store(s->point[POINT_Q + 2 * m + 1] + i, qy);
      store(s->point[POINT_W + 2 * m] + i, wx);
      store(s->point[POINT_W + 2 * m + 1] + i, wy);
    }
    if (f->axis) {
      fill_axis(f, m, qx, qy, g * vx, g * vy, i, column, given, belt);
    }
  }
  for (int u = 0; f->axis && u < 2; ++u) {
    const bd_body *body = f->axis->body;
    double *const *const to = s->point + AXIS_COLUMN;
    store((belt == STRING ? body->column + u * stride : to[u]) + i, column[u]);
    store((belt == STRING ? body->given + u * stride : to[2 + u]) + i, given[u]);
  }
  if (f->of->c) {
    correct_points(f, nx, ny, lever, by_normal, i, sums, belt);
  }
  if (!friction) {
    return;
  }
  const vec spin = g * by_slip * lever;
  store(slot->rho + i, -(g * lever));
  store((belt == STRING ? f->body->column : s->point[COLUMN]) + i, ny * spin);
  store((belt == STRING ? f->body->column + stride : s->point[COLUMN + 1]) + i, -(nx * spin));
  sums->own = fma_(spin, lever, sums->own);
  if (belt != STRING) {
    store(s->point[FORCE] + i, force * ny);
    store(s->point[FORCE + 1] + i, -(force * nx));
  }
}

/* --- from points to nodes -------------------------------------------------------------------- */

/* Forces at joints, half of which acts on each link. */
INLINE link_force of_joints(const bd_tangent *tangent, const double *x, const double *y, int i) {
  const vec half = splat(0.5);
  return force_of_ends(load(tangent->cos + i), load(tangent->sin + i), half * load(x + i),
                       half * load(y + i), half * load_unaligned(x + i + 1),
                       half * load_unaligned(y + i + 1));
}

/* Joints into the blocks of their links. */
INLINE void fill_links(const filling *f, int i) {
  const bd_contact_scratch *scratch = f->scratch;
  const vec c = load(f->tangent->cos + i), s = load(f->tangent->sin + i), half = splat(0.5);
  const vec fx = load_unaligned(scratch->point[FORCE] + i + 1) - load(scratch->point[FORCE] + i);
  const vec fy =
      load_unaligned(scratch->point[FORCE + 1] + i + 1) - load(scratch->point[FORCE + 1] + i);
  const vec turning = f->g2 / f->arm * fma_(c, fx, s * fy);
  for (int m = 0; m < 2; ++m) { /* Q, then W, which has the other sign */
    double *const *const point = scratch->point + (m ? POINT_W : POINT_Q);
    double *const to = m ? f->blocks->w.tiles : f->blocks->q.tiles;
    for (int k = 0; k < 3; ++k) {
      const vec sign = m ? splat(-0.5) : k == 2 ? half * f->arm : half;
      const vec bx = load(point[2 * k] + i), by = load(point[2 * k + 1] + i);
      const vec hx = load(point[6 + 2 * k] + i), hy = load(point[7 + 2 * k] + i);
      const vec rx = load_unaligned(point[2 * k] + i + 1);
      const vec ry = load_unaligned(point[2 * k + 1] + i + 1);
      const vec ax = load_unaligned(point[6 + 2 * k] + i + 1);
      const vec ay = load_unaligned(point[7 + 2 * k] + i + 1);
      const vec turned = fnma_(s, rx - hx, c * (ry - hy));
      const vec entries[3][3] = {{bx, by, fnma_(c, by, s * bx)},
                                 {hx + rx, hy + ry, k == 2 ? turned - turning : turned},
                                 {ax, ay, fnma_(s, ax, c * ay)}};
      for (int place = 0; place < 3; ++place) {
        for (int u = 0; u < 3; ++u) {
          double *const at = entry_of(to, 3, i, place, 3 * u + k);
          store(at, fma_(sign, entries[place][u], load(at)));
        }
      }
    }
  }
  if (f->of->c) {
    const mask link = less(splat(0.0), load(f->links->link_mask + i));
    const link_force by = of_joints(f->tangent, scratch->point[MORE], scratch->point[MORE + 1], i);
    accelerate(f->links, f->of->c, i,
               (link_force){where(link, by.x), where(link, by.y), where(link, by.p)}, LINKS);
  }
}

/* A row by nodes from what stands with the points. */
INLINE void fill_row(const filling *f, double *const *points, double *row, int i, const int add,
                     const int belt) {
  const mask link = less(splat(0.0), load(f->links->link_mask + i));
  for (int k = 0; k < (belt == STRING ? 2 : 3); ++k) {
    double *const to = row + k * f->links->lay.stride;
    vec entry =
        load_unaligned(points[k] + i + 1) + load(points[belt == STRING ? 2 + k : 3 + k] + i);
    entry = belt == STRING ? entry + load_unaligned(points[4 + k] + i - 1) : entry;
    store(to + i, where(link, add ? load(to + i) + entry : entry));
  }
}

INLINE void fill_column(const filling *f, const double *x, const double *y, double *column, int i,
                        const int add) {
  const mask link = less(splat(0.0), load(f->links->link_mask + i));
  const link_force by = of_joints(f->tangent, x, y, i);
  const vec parts[3] = {by.x, by.y, by.p};
  for (int k = 0; k < 3; ++k) {
    double *const to = column + k * f->links->lay.stride;
    store(to + i, where(link, add ? load(to + i) + parts[k] : parts[k]));
  }
}

INLINE void fill_border(const filling *f, int i, const int belt, const int friction) {
  const bd_contact_scratch *s = f->scratch;
  if (friction) {
    fill_row(f, s->point + ROW_Q, f->body->q, i, 0, belt);
    fill_row(f, s->point + ROW_W, f->body->w, i, 0, belt);
  }
  if (f->axis) {
    fill_row(f, s->point + AXIS_Q, f->axis->body->q, i, belt != STRING, belt);
    fill_row(f, s->point + AXIS_W, f->axis->body->w, i, belt != STRING, belt);
  }
  if (belt != STRING) {
    fill_column(f, s->point[COLUMN], s->point[COLUMN + 1], f->body->column, i, 0);
    if (f->axis) {
      fill_column(f, s->point[AXIS_COLUMN], s->point[AXIS_COLUMN + 1], f->axis->body->column, i, 1);
      fill_column(f, s->point[AXIS_COLUMN + 2], s->point[AXIS_COLUMN + 3], f->axis->body->given, i,
                  1);
    }
  }
}

/* A run's points end where it ends; but behind the last one comes the first. */
INLINE void end_runs(double *const *arrays, size_t n_arrays, int n_runs, const bd_run *runs,
                     int n) {
  for (int r = 0; r < n_runs; ++r) {
    const int end = runs[r].end, round = end >= n && runs[0].begin == 0;
    for (size_t k = 0; k < n_arrays; ++k) {
      arrays[k][end < n ? end : n] = round ? arrays[k][0] : 0.0;
    }
  }
}

/* --- a pulley -------------------------------------------------------------------------------- */

INLINE void fill_normal_forces(const filling *f, int n_runs, const bd_run *runs, vec_sums *sums,
                               const int belt) {
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      if (f->pulley->hunt_crossley > 0.0) {
        fill_segment_forces(f, i, sums, belt, 1);
      } else {
        fill_segment_forces(f, i, sums, belt, 0);
      }
    }
  }
}

INLINE void fill_nodes(const filling *f, int n_runs, const bd_run *runs, const int belt,
                       const int friction) {
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      if (belt != STRING) {
        fill_links(f, i);
      }
      fill_border(f, i, belt, friction);
    }
  }
}

/* What no law decides is compiled once for all of them: compiling takes half of the time. */
static void fill_link_forces(const filling *f, int n_runs, const bd_run *runs, vec_sums *sums) {
  fill_normal_forces(f, n_runs, runs, sums, LINKS);
}

static void fill_string_forces(const filling *f, int n_runs, const bd_run *runs, vec_sums *sums) {
  fill_normal_forces(f, n_runs, runs, sums, STRING);
}

static void fill_nodes_links(const filling *f, int n_runs, const bd_run *runs) {
  fill_nodes(f, n_runs, runs, LINKS, 1);
}

static void fill_nodes_string(const filling *f, int n_runs, const bd_run *runs) {
  fill_nodes(f, n_runs, runs, STRING, 1);
}

INLINE bd_fill_sums fill_pulley(const bd_links *links, const bd_tangent *tangent,
                                const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                                const bd_fill *fill, const bd_contact_scratch *scratch,
                                const bd_assembled *blocks, const bd_slot *slot,
                                const bd_body *body, const bd_axis *axis, const int belt,
                                const int law, const int general, const int states) {
  const int n = links->lay.n, friction = law != BD_LAW_NONE, columns = columns_of(belt);
  const filling f = {links,
                     tangent,
                     pulley,
                     fill,
                     scratch,
                     blocks,
                     body,
                     axis,
                     splat(fill->g),
                     splat(fill->g * fill->g),
                     splat(links->half)};
  if (belt == CENTRES) {
    return fill_at_centres(&f, n_runs, runs, slot, law, general, states);
  }
  vec_sums sums = {splat(0.0), splat(0.0), splat(0.0), splat(0.0)};
  (belt == STRING ? fill_string_forces : fill_link_forces)(&f, n_runs, runs, &sums);
  if (friction || belt == STRING) {
    const bd_pressure p = scratch->pressure;
    double *const closed[] = {p.right, p.share_right, p.rate_right, scratch->correction[1]};
    close_runs(closed, 4, n_runs, runs, n, 0.0);
    close_runs(scratch->end[1], (size_t)(4 * columns), n_runs, runs, n, 0.0);
    const joint_points from = points_of(&links->lay, &scratch->points, fill->y, belt == STRING);
    const double *zs =
        states != 0 ? bd_cfield(&links->lay, fill->y, bd_f_state(&links->lay, pulley->slot)) : NULL;
    const law_constants constants = law_prepare(&pulley->friction, pulley->l0, law);
    for (int r = 0; r < n_runs; ++r) {
      for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
        fill_point_friction(&f, &constants, &from, zs, slot, i, &sums, belt, law, general, states);
      }
    }
    end_runs(scratch->point, axis ? BD_POINT_ROWS : OF_MOUNT, n_runs, runs, n);
    for (int k = 0; friction && k < pulley->states; ++k) {
      double *const given[] = {slot->given_x + k * pulley->stride,
                               slot->given_y + k * pulley->stride};
      end_runs(given, 2, n_runs, runs, n);
    }
    if (belt == STRING) {
      close_runs(scratch->point, axis ? BD_POINT_ROWS : OF_MOUNT, n_runs, runs, n, 0.0);
    }
    if (friction) {
      (belt == STRING ? fill_nodes_string : fill_nodes_links)(&f, n_runs, runs);
    } else {
      fill_nodes(&f, n_runs, runs, belt, 0);
    }
  }
  return (bd_fill_sums){sum(sums.own), sum(sums.torque), {sum(sums.x), sum(sums.y)}};
}

#define FILL(law, belt, of, general, states)                                                       \
  static bd_fill_sums fill_pulley_##law##_##of(                                                    \
      const bd_links *links, const bd_tangent *tangent, const bd_contact_pulley *pulley,           \
      int n_runs, const bd_run *runs, const bd_fill *fill, const bd_contact_scratch *scratch,      \
      const bd_assembled *blocks, const bd_slot *slot, const bd_body *body, const bd_axis *axis) { \
    return fill_pulley(links, tangent, pulley, n_runs, runs, fill, scratch, blocks, slot, body,    \
                       axis, belt, BD_LAW_##law, general, states);                                 \
  }
#define LAW(name, class, general, states, text)                                                    \
  FILL(name, LINKS, links, general, states)                                                        \
  FILL(name, CENTRES, centres, general, states) FILL(name, STRING, string, general, states)
LAW(NONE, , 0, 0, )
BD_LAWS(LAW)
#undef LAW
