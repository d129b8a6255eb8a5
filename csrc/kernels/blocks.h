/* SPDX-License-Identifier: MIT
 *
 * What is the same for every belt once its blocks are assembled (bd_matrix): products, rows of
 * bodies, states of friction. Compiled once per instruction level, in jacobian.h.
 */

/* Belts by what contact acts on: links along their length, links at their centres, masses. */
enum { LINKS, CENTRES, STRING };

/* Entry e, by rows, of a block of node i and those from there on: 0 back, 1 diagonal, 2 ahead. */
INLINE double *entry_of(double *tiles, const int d, int i, const int place, const int e) {
  return tiles + i / BD_LANES * (3 * d * d * BD_LANES) + (d * d * place + e) * BD_LANES +
         i % BD_LANES;
}

/* On a link in its three unknowns. */
typedef struct link_force {
  vec x, y, p;
} link_force;

INLINE link_force force_of_ends(vec c, vec s, vec lx, vec ly, vec rx, vec ry) {
  return (link_force){lx + rx, ly + ry, fnma_(s, rx - lx, c * (ry - ly))};
}

INLINE void add_to(double *array, int i, vec v) {
  store(array + i, load(array + i) + v);
}

/* Of links that joints alone couple, over k: what moves of an end are worth at its joint; p. */
typedef struct held_end {
  vec x, y, p;
} held_end;

INLINE held_end held_end_of(const bd_matrix *q, const double *cq, int i, const double side) {
  const bd_tangent *t = q->joints;
  const vec c = load_unaligned(t->cos + i), s = load_unaligned(t->sin + i);
  const vec p = splat(q->arm) * load_unaligned(cq + 2 * q->stride + i), turned = splat(side) * p;
  const vec turn = splat(q->spin / q->k) * load_unaligned(t->spin + i) * turned;
  const vec x = load_unaligned(cq + i), y = load_unaligned(cq + q->stride + i);
  return (held_end){fma_(s, turned, fma_(c, turn, x)), fnma_(c, turned, fma_(s, turn, y)), p};
}

/* Adds what joints are worth to these links: by the right ends of those behind, the left ends of
 * those ahead, and by themselves. */
INLINE void joints_product(const bd_matrix *q, const double *cq, int i, vec *out) {
  const held_end behind = held_end_of(q, cq, i - 1, -1.0), ahead = held_end_of(q, cq, i + 1, 1.0);
  const vec k = splat(q->k), straight = splat(q->mass + 2.0 * q->k);
  const vec x = load(cq + i), y = load(cq + q->stride + i);
  const vec p = splat(q->arm) * load(cq + 2 * q->stride + i);
  const vec held = fnma_(load(q->joints->sin + i), behind.x - ahead.x,
                         load(q->joints->cos + i) * (behind.y - ahead.y));
  const vec bent =
      fma_(splat(q->pull), load(q->joints->pull + i), splat(q->inertia + 2.0 * (q->k + q->bend)));
  out[0] = fma_(straight, x, fnma_(k, behind.x + ahead.x, out[0]));
  out[1] = fma_(straight, y, fnma_(k, behind.y + ahead.y, out[1]));
  out[2] = fnma_(splat(q->bend), behind.p + ahead.p, fma_(k, held, out[2]));
  out[2] = fma_(bent, p, out[2]);
  for (int u = 0; q->tiles && u < 2; ++u) {
    const double *contact = q->tiles + 2 * u * q->stride + i;
    out[u] = fma_(load(contact), x, fma_(load(contact + q->stride), y, out[u]));
  }
}

/* r = M c_v + Q c_q; the halo of c_q is set on both sides. */
INLINE void blocks_product(const int d, const bd_layout *lay, const bd_matrix q, const double *cq,
                           const double *cv, const double *mass, double *const *r,
                           const int joints) {
  const int stride = lay->stride;
  double *const to[3] = {r[0], r[1], r[2]};
  vec inertia[3];
  for (int u = 0; u < d; ++u) {
    inertia[u] = splat(mass[u]);
  }
  /* the first links last: what stands behind the ring's ends has just been stored */
  for (int next = WIDTH; next <= lay->n8; next += WIDTH) {
    const int i = next < lay->n8 ? next : 0;
    vec out[3];
    for (int u = 0; u < d; ++u) {
      out[u] = inertia[u] * load(cv + u * stride + i);
    }
    if (joints) {
      joints_product(&q, cq, i, out);
    }
    for (int k = 0; k < d && !joints; ++k) {
      const double *c = cq + k * stride + i;
      const vec near[3] = {load_unaligned(c - 1), load(c), load_unaligned(c + 1)};
      for (int place = 0; place < 3; ++place) {
        for (int u = 0; u < d; ++u) {
          const double *entry = entry_of(q.tiles, d, i, place, d * u + k);
          out[u] = fma_(load(entry), near[place], out[u]);
        }
      }
    }
    for (int u = 0; u < d; ++u) {
      store(to[u] + i, out[u]);
    }
  }
}

/* A row of a body times what nodes of its runs have. */
INLINE double row_runs(const int d, const bd_layout *lay, int n_runs, const bd_run *runs,
                       const double *row, const double *const *v) {
  vec total = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      for (int k = 0; k < d; ++k) {
        total = fma_(load(row + k * lay->stride + i), load(v[k] + i), total);
      }
    }
  }
  return sum(total);
}

/* Adds to the right-hand side what a mount's column has of its given travel. */
INLINE void add_column(const int d, const bd_layout *lay, int n_runs, const bd_run *runs,
                       const double *column, double factor, double *const *r) {
  for (int n = 0; n < n_runs; ++n) {
    for (int i = runs[n].begin; i < runs[n].end; i += WIDTH) {
      for (int k = 0; k < d; ++k) {
        add_to(r[k], i, splat(factor) * load(column + k * lay->stride + i));
      }
    }
  }
}

static double sum_runs(int n_runs, const bd_run *runs, const double *array) {
  vec total = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      total += load(array + i);
    }
  }
  return sum(total);
}

/* From the nodes' velocities without the bodies' to all their unknowns, in place: c becomes the
 * solution, but for friction in contact, and 0 behind the last node, all the way to the next block:
 * differences of states over a step's length make what stands there grow without end. A body's
 * column, times its acceleration, is three blocks; the third unknown is that of a link's end. */
INLINE void finish_nodes(const int d, const bd_links *links, double g_, int n_columns,
                         const double *columns, const double *factors, const double *x,
                         const double *y, const double *p, double *c) {
  const bd_layout *lay = &links->lay;
  const size_t stride = (size_t)lay->stride;
  const vec g = splat(g_), inv_half = splat(1.0 / links->half), none = splat(0.0);
  double *cx = bd_field(lay, c, F_X), *cvx = bd_field(lay, c, F_VX);
  double *cmu = bd_field(lay, c, F_MU);
  for (int i = 0; i < lay->stride - BD_HALO; i += WIDTH) {
    vec v[3] = {load(x + i), load(y + i), d == 3 ? load(p + i) : none};
    for (int j = 0; j < n_columns; ++j) {
      const double *column = columns + (size_t)(3 * j) * stride + i;
      const vec factor = splat(factors[j]);
      for (int k = 0; k < d; ++k) {
        v[k] = fnma_(factor, load(column + (size_t)k * stride), v[k]);
      }
    }
    const mask link = less(none, load(links->link_mask + i));
    v[2] *= inv_half;
    for (int k = 0; k < d; ++k) {
      const size_t at = (size_t)k * stride + (size_t)i;
      store(cx + at, where(link, g * (load(cx + at) + v[k])));
      store(cvx + at, where(link, v[k]));
    }
    for (int k = 0; k < lay->slots * (lay->states + 1); ++k) {
      const size_t at = (size_t)k * stride + (size_t)i;
      store(cmu + at, where(link, g * load(cmu + at)));
    }
  }
}

/* Whether the column moves the point itself; whether it is an angle. */
INLINE int moves_point(const int m, const int belt) {
  return belt != STRING || m / 2 == 1;
}

INLINE int is_angle(const int m, const int belt) {
  return belt == LINKS && m % 3 == 2;
}

/* What given states of friction, whose halo ahead is set, are worth at the nodes; into sums their
 * torque, with what the pulley's row has of given positions, and their force. */
INLINE void states_product(const int belt, const bd_layout *lay, const bd_tangent *tangent,
                           int n_runs, const bd_run *runs, int states, const bd_slot *slot,
                           const double *cz, const double *row, const double *cq, double *const *to,
                           double *sums) {
  const int stride = lay->stride, columns = belt == LINKS ? 3 : 2;
  vec torque = splat(0.0), x = splat(0.0), y = splat(0.0), of_row = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      vec fx = splat(0.0), fy = splat(0.0), rx = splat(0.0), ry = splat(0.0);
      for (int m = 0, k = i; m < columns; ++m, k += stride) {
        const vec q = load(cq + k);
        of_row = fma_(load(row + k), q, of_row);
        if (belt == CENTRES) {
          fx = fma_(load(slot->held_x + k), q, fx);
          fy = fma_(load(slot->held_y + k), q, fy);
        }
      }
      for (int k = i; k < i + states * stride; k += stride) {
        const vec z = load(cz + k);
        fx = fma_(load(slot->given_x + k), z, fx);
        fy = fma_(load(slot->given_y + k), z, fy);
        torque = fma_(load(slot->given_torque + k), z, torque);
        if (belt == LINKS) {
          const vec after = load_unaligned(cz + k + 1);
          rx = fma_(load_unaligned(slot->given_x + k + 1), after, rx);
          ry = fma_(load_unaligned(slot->given_y + k + 1), after, ry);
        }
      }
      if (belt != CENTRES) { /* the first comes again behind */
        const mask link = less(lane_numbers(), splat(lay->n - i));
        x += where(link, fx);
        y += where(link, fy);
      }
      if (belt == LINKS) {
        const vec half = splat(0.5);
        const link_force f = force_of_ends(load(tangent->cos + i), load(tangent->sin + i),
                                           half * fx, half * fy, half * rx, half * ry);
        add_to(to[0], i, f.x);
        add_to(to[1], i, f.y);
        add_to(to[2], i, f.p);
      } else {
        add_to(to[0], i, fx);
        add_to(to[1], i, fy);
      }
    }
  }
  sums[0] = sum(torque) + sum(of_row);
  sums[1] = sum(x);
  sums[2] = sum(y);
}

/* A row by the columns of points, of nodes that move against an axis by `move` more. */
INLINE vec point_row(double *const *q, double *const *v, int k, const double *cq, const double *cv,
                     const double *move, int stride, int i, vec total, const int own,
                     const int belt) {
  const int d = belt == STRING ? 2 : 3, centres = belt == CENTRES;
  vec other = splat(0.0);
  for (int m = 0; m < (centres ? 2 : 6); ++m) {
    if (own && !moves_point(m, belt)) {
      continue;
    }
    const int at = m % d * stride + i + (centres ? 0 : m / d - 1);
    vec x = load_unaligned(cq + at), s = load_unaligned(cv + at);
    if (move && !is_angle(m, belt)) {
      x += splat(move[m % d]);
      s += splat(move[2 + m % d]);
    }
    total = fma_(load(q[m] + k), x, total);
    other = fma_(load(v[m] + k), s, other);
  }
  return total + other;
}

/* States of friction and slip: all else is solved, its halo set. */
INLINE void restore_states(const int belt, const bd_layout *lay, int n_runs, const bd_run *runs,
                           int states, const bd_slot *slot, const double *link_mask, double spin_,
                           const double *move, const double *cq, const double *cv, double *cz,
                           double *cslip) {
  const int stride = lay->stride;
  const vec spin = splat(spin_), none = splat(0.0);
  for (int r = 0; r < n_runs; ++r) {
    for (int i = runs[r].begin; i < runs[r].end; i += WIDTH) {
      const mask link = less(none, load(link_mask + i));
      const vec slide = point_row(slot->sq, slot->sv, i, cq, cv, move, stride, i,
                                  load(slot->rho + i) * spin, 1, belt);
      store(cslip + i, where(link, load(cslip + i) + slide));
      for (int k = i; k < i + states * stride; k += stride) {
        vec z = fma_(load(slot->by_slip + k), slide, load(slot->decay + k) * load(cz + k));
        if (any(less(none, load(slot->others + k)))) {
          z = point_row(slot->zq, slot->zv, k, cq, cv, move, stride, i, z, 0, belt);
        }
        store(cz + k, where(link, z));
      }
    }
  }
}

#define NODES(belt, d)                                                                             \
  static void add_column_##belt(const bd_layout *lay, int n_runs, const bd_run *runs,              \
                                const double *column, double factor, double *const *r) {           \
    add_column(d, lay, n_runs, runs, column, factor, r);                                           \
  }                                                                                                \
  static void finish_nodes_##belt(const bd_links *links, double g, int n_columns,                  \
                                  const double *columns, const double *factors, const double *x,   \
                                  const double *y, const double *p, double *c) {                   \
    finish_nodes(d, links, g, n_columns, columns, factors, x, y, p, c);                            \
  }
NODES(links, 3)
NODES(string, 2)

#define SOLVES(belt, of, d)                                                                        \
  static void blocks_product_##of(const bd_layout *lay, const bd_matrix *q, const double *cq,      \
                                  const double *cv, const double *mass, double *const *r) {        \
    blocks_product(belt == STRING ? 2 : 3, lay, *q, cq, cv, mass, r, belt == CENTRES);             \
  }                                                                                                \
  static double row_runs_##of(const bd_layout *lay, int n_runs, const bd_run *runs,                \
                              const double *row, const double *const *v) {                         \
    return row_runs(d, lay, n_runs, runs, row, v);                                                 \
  }                                                                                                \
  static void states_product_##of(const bd_layout *lay, const bd_tangent *tangent, int n_runs,     \
                                  const bd_run *runs, int states, const bd_slot *slot,             \
                                  const double *cz, const double *row, const double *cq,           \
                                  double *const *to, double *sums) {                               \
    states_product(belt, lay, tangent, n_runs, runs, states, slot, cz, row, cq, to, sums);         \
  }                                                                                                \
  static void restore_states_##of(const bd_layout *lay, int n_runs, const bd_run *runs,            \
                                  int states, const bd_slot *slot, const double *link_mask,        \
                                  double spin, const double *move, const double *cq,               \
                                  const double *cv, double *cz, double *cslip) {                   \
    if (move) {                                                                                    \
      restore_states(belt, lay, n_runs, runs, states, slot, link_mask, spin, move, cq, cv, cz,     \
                     cslip);                                                                       \
    } else {                                                                                       \
      restore_states(belt, lay, n_runs, runs, states, slot, link_mask, spin, NULL, cq, cv, cz,     \
                     cslip);                                                                       \
    }                                                                                              \
  }
SOLVES(LINKS, links, 3)
SOLVES(CENTRES, centres, 2)
SOLVES(STRING, string, 2)
