/* SPDX-License-Identifier: MIT
 *
 * ALE belt (MODEL section 11), which flows through a mesh that stands still: what its kernels work
 * on.
 *
 * An arc and the span behind it are a slab of slots. Cell k of the arc stands in slot begin + k, k
 * < n, the span's only cell in begin + n; node k, where cell k begins, stands in the same slot, the
 * last one (k = n) where the arc ends and the span begins. What is behind them up to the next slab
 * is padding: copies of the nodes and cells that follow and go before, so that a slot's neighbours
 * are one to the left and one to the right, round the whole ring.
 */
#ifndef BELTDYN_ALE_H
#define BELTDYN_ALE_H

#include <math.h>

#include "base/base.h"

/* Sine modes of a span: with 4 the lowest frequency of a running one is right to 0.2 % and the
 * second to 0.4 % at half the waves' speed, with 2 to 1.3 % and not at all (MODEL section 11.10).
 * Knots of a table; unknowns of a block at most. */
enum {
  BD_ALE_MODES = 4,
  BD_ALE_POWERS = 4,
  BD_ALE_KNOTS = 100,
  BD_ALE_BLOCK = 3 + 4 * BD_MAX_ELEMENTS
};

/* X(H) of a span, without its part of 1/S, over log H: a cubic spline by values and slopes times
 * the knots' distance; and its integral over H, by which energy is known. */
typedef struct bd_ale_table {
  double value[BD_ALE_KNOTS], slope[BD_ALE_KNOTS];
  double sum[BD_ALE_KNOTS], by_knot[BD_ALE_KNOTS], by_slope[BD_ALE_KNOTS]; /* and what it is of */
} bd_ale_table;

/* The axis of a pulley at an evaluation. */
typedef struct bd_ale_axis {
  double c[2], v[2];
  double known[2];       /* its acceleration but for that of the travel, */
  double lever[2];       /* along which that moves it; 0: nothing does */
  double bend[2], speed; /* by how much that turns with the travel; of the travel */
  double omega;          /* of what the belt runs on */
} bd_ale_axis;

typedef struct bd_ale_arc {
  int begin, n, slots; /* its first slot, its cells, slots up to the next slab */
  int before, next;    /* pulleys */
  int states;          /* of friction, of an end of a cell */
  int mounted;         /* its axis moves, or may */
  int held; /* the law's state is a coefficient, which does not change where nothing presses */
  bd_friction friction;
  double side, sense;                 /* s; D s: of rims along the belt */
  double radius, line_radius, raised; /* R; R_g; depth of a compensated contact */
  double damping, axial_part; /* along its cells, with what contact dampers give; not theirs */
  bd_ale_axis axis;
  double moment; /* what lifts the line off the pulley, times the force along it */
  /* of t in a cell, as it turns from end to end; its rate; -s tan of half */
  double wrap, cell_angle, cell_turning, half_turn;
  double torque, contact_loss, slip_loss; /* on the pulley; powers */
  /* On the axis, but for what its own acceleration adds; the belt's inertia along the lever. */
  double force[2], inertia;
} bd_ale_arc;

/* What waves of a span are at the end of the last step: clamped in the wraps they have wave numbers
 * of their own. H; of both ends the angle by which their pressure has rolled on with waves, that at
 * rest, and by how much waves lift them more as H rises. Of modes wave number, EI_n, by how much
 * more than as k^2 their stiffness goes with H, 1 / (1 + mu_n), gyroscopic coupling. */
typedef struct bd_ale_waves {
  double pressing, rolled[2], rest[2], lifts[2];
  double number[BD_ALE_MODES], stiff[BD_ALE_MODES], rises[BD_ALE_MODES], eased[BD_ALE_MODES];
  double gyro[BD_ALE_MODES][BD_ALE_MODES];
} bd_ale_waves;

/* From pulley i, by whose number it goes, to the next one. */
typedef struct bd_ale_span {
  bd_ale_waves *waves;
  /* constant */
  double curvature[2]; /* s / R of both pulleys */
  double tilt;         /* o H: by how much their offsets of the line differ, times H */
  double raised;       /* the same of the offsets that geometry has */
  double bend[BD_ALE_POWERS][BD_ALE_MODES]; /* A_n by powers of sqrt(EI / H), from its square on */
  const bd_ale_table *table;
  double damping, axial_part, pressed; /* along it; of contact, over the rate of H */
  /* of both ends: contact dampers, by the speed at which belt runs on or off, and dampers of
   * bending over those of a belt whose curvature jumps on the pulley to what it is there; s R by
   * which that speed goes with the angle of waves there, positive where it adds */
  double sinks[2], damps[2], rolls[2];
  /* geometry */
  double placed[2][4]; /* for centers and speeds of both axes; whether those were others before */
  int is_new;
  double length, e[2], n[2], turning, length_rate;
  double wave[BD_ALE_MODES], offset[BD_ALE_MODES], moved[BD_ALE_MODES];
  double sag; /* g.n */
  /* tension: flow past the mesh, force, H, stretch, the path that sines of these slopes are, X + E,
   * its slope by H, 1 / (dT of what is left over), the slope of that slope; the rate at which ends
   * and waves draw it out, that at which waves do but for the path of sines, the damper's force */
  double past, elastic, pressing, stretch, bent, path, by_pressing, per_slope, bends, drawn, turns;
  double damped;
  /* A_n, by how much that falls with H, (S / 2) lambda_n A_n; by how much they draw the span out,
   * and moments of ends that roll */
  double rest[BD_ALE_MODES], falls[BD_ALE_MODES], pushed[BD_ALE_MODES], draws[BD_ALE_MODES];
  double turned[BD_ALE_MODES];
  double slope[2], lifted[2]; /* of waves, and by waves, the angle at both ends */
  /* momentum: a', G a, G a', a + b, p~', without what m' and c' do, and sums of theirs; c' */
  double da[BD_ALE_MODES], ga[BD_ALE_MODES], gda[BD_ALE_MODES], ab[BD_ALE_MODES], dp[BD_ALE_MODES];
  double forced[BD_ALE_MODES];
  /* What dampers of bending and contact take at both ends; over the speed, of both and of bending
   */
  double losing[2], per_losing[2], per_bending[2];
  double lateral, first, added, quickens, matrix[3];
  double carried, per_path; /* rhoA c / lambda; path by what draws the span out */
  double coupling;          /* inertia by which mounts at both ends feel each other */
  /* a wave along it: inertia that either end lends it, force on either by it and by its rate; its
   * rate, and that force */
  double along_inertia, along_stiffness, along_damping, along_rate, along_force;
} bd_ale_span;

/* A block of numbers by slot each. Fixed: of nodes the fraction of the wrap, 1 in cells of arcs,
 * else 0; in a step what W at both ends of what lies on the pulley of a cell has of the end of the
 * wrap, and the depth there over the cell's; s R / e of the end, what lies as fractions of the cell
 * (0 and 1 if nothing does), 1 if something lies there, else 0. Of nodes: t, Omega, V.n; w, c; J, 1
 * / lambda; what moves them, 1 / their mass. Of cells: 1 / m, 1 / rho, d, lambda, T without damping
 * and with it, H, energy of bending less that of contact per metre, the shear by which the end of
 * the wrap loads it. Of both ends of cells friction, F (u' - u) along t and n, what both lose as
 * the path between them grows longer, and for that by their rates; after a rate the part of that.
 */
#define BD_ALE_FIXED(X)                                                                            \
  X(fraction) X(is_cell) X(end_a) X(end_b) X(deep_a) X(deep_b) X(roll) X(cut_a) X(cut_b) X(lies)
#define BD_ALE_AT_NODES(X) X(tx) X(ty) X(turn) X(across) X(slid) X(past)
#define BD_ALE_THROUGH_NODES(X) X(flow) X(per_stretch) X(total) X(per_mass)
#define BD_ALE_OF_CELLS(X)                                                                         \
  X(per_m) X(per_rho) X(sink) X(stretch) X(elastic) X(tension) X(pressing) X(bent) X(shear)
#define BD_ALE_AT_ENDS(X) X(force_a) X(force_b) X(carried_t) X(carried_n) X(slows) X(lags)
#define BD_ALE_SLOTS(X)                                                                            \
  BD_ALE_FIXED(X)                                                                                  \
  BD_ALE_AT_NODES(X) BD_ALE_THROUGH_NODES(X) BD_ALE_OF_CELLS(X) BD_ALE_AT_ENDS(X)

typedef struct bd_ale {
  int np, slots, cells;
  double direction; /* D: of numbering, +1 counter-clockwise */
  double density, axial, axial_damping, bending, bending_damping; /* rhoA, EA, eta A, EI, eta I */
  double quadratic, linear;                                       /* contact, per metre */
  double gravity[2], rest;                                        /* H0 */
  double elapsed; /* in the step, at whose end ends of wraps are renewed */
  int moving;     /* axes do, or may: geometry is laid anew, and forces on these are known */
  int along;      /* spans have a wave along them */
  int everywhere; /* forces on all axes are wanted */
  double odd[BD_ALE_MODES], parts[2][BD_ALE_MODES];
  double left_over[3]; /* of a span's consistent mass what its modes do not carry */
  bd_ale_arc *arcs;
  bd_ale_span *spans;
  bd_ale_waves *waves; /* by span */
#define X(name) double *name;
  BD_ALE_SLOTS(X)
#undef X
} bd_ale;

/* A state, or its rates: m, v by slot; z of both ends of cells, an element `stride` after the
 * other; a and p by span, `modes` each; waves along spans and their speeds. */
typedef struct bd_ale_state {
  double *m, *v, *z[2], *a, *p, *along, *along_speed;
  int stride;
} bd_ale_state;

/* Derivatives by cell of an arc, with the flow through it held: of its stretch by its metres; of
 * what moves the node at either end, over which its mass stands, and of the torque, by its metres,
 * by the speeds of both nodes, by that of the rim, by the shear; rates of states at either end by
 * the same, by themselves, and what moves the node by them, elements `stride` after one another. */
enum { BD_ALE_M, BD_ALE_V, BD_ALE_V_AFTER, BD_ALE_RIM, BD_ALE_SHEAR, BD_ALE_BYS };

typedef struct bd_ale_slopes {
  double *stretch, *total[2][BD_ALE_BYS], *torque[BD_ALE_BYS];
  double *rate[2][BD_ALE_BYS], *rate_z[2], *total_z[2];
} bd_ale_slopes;

/* Unknowns of a span, with a wave along it; what moves its first node, its last one, the rate of
 * its metres. One more of each moves all that the rates of a span depend on by so much, and these
 * answer. */
enum { BD_ALE_ALONG = 3 + 2 * BD_ALE_MODES, BD_ALE_OF_SPAN = BD_ALE_ALONG + 2 };
enum { BD_ALE_FIRST = BD_ALE_OF_SPAN, BD_ALE_LAST, BD_ALE_FILLS, BD_ALE_MOVES = 16 };

typedef struct bd_ale_moves {
  double m[BD_ALE_MOVES], past[BD_ALE_MOVES], pull[BD_ALE_MOVES], stretch[BD_ALE_MOVES];
  double fills[BD_ALE_MOVES], total[2][BD_ALE_MOVES], losing[2][BD_ALE_MOVES];
  double pressing[BD_ALE_MOVES], lifted[2][BD_ALE_MOVES];
  double a[BD_ALE_MODES][BD_ALE_MOVES], p[BD_ALE_MODES][BD_ALE_MOVES];
} bd_ale_moves;

typedef struct bd_ale_answers {
  double v[2][BD_ALE_MOVES], p[BD_ALE_MODES][BD_ALE_MOVES];
} bd_ale_answers;

/* A block of unknowns, whether it has four and those behind and ahead have: of the Jacobian what
 * couples it to the block behind, to itself, to the one ahead, by columns, the rows of each in
 * fours; of its elimination D^-1, by it what couples it to both neighbours and to the last block,
 * and what that one has of it (ale_blocks.h). */
typedef struct bd_ale_block {
  int n, lead, at; /* unknowns; rows of a column; the first of them */
  int usual[2];
  double *back, *own, *ahead;
  double *inverse, *over[2], *far, *from;
} bd_ale_block;

/* The ring of blocks: a span, with both its ends; a cell of an arc and a node; the two cells in the
 * middle of an arc with the node between. The last one stands apart as they are eliminated. */
typedef struct bd_ale_ring {
  int n, unknowns;
  double g;
  bd_ale_block *blocks;
  double *from, *scratch; /* what the last block has of all others; a block of the largest size */
  double *lanes;          /* unknowns of BD_LANES right-hand sides */
} bd_ale_ring;

/* X + E of a span, its slope by H, and the slope of that, but for what is nothing where waves
 * rest. */
typedef struct bd_ale_path {
  double x, slope, bends;
} bd_ale_path;

typedef struct bd_ale_kernels {
  /* In this order. Axes into geometry; tension and flow; what of the normal force acts at the ends
   * of cells (after a step only), and states of friction of belt that is laid on anew (y NULL: at
   * the start, none); friction of an arc [law], which sets the rates of z; all other
   * rates, and forces on axes. */
  void (*place)(bd_ale *ale);
  void (*stretch)(bd_ale *ale, const bd_ale_state *y);
  void (*freeze)(bd_ale *ale, const bd_ale_state *y);
  void (*add_friction[BD_N_LAWS])(bd_ale *ale, int j, const bd_ale_state *y,
                                  const bd_ale_state *dy);
  void (*move)(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy);
  /* Of a span whose waves are known; and where they rest, angles of its ends. */
  bd_ale_path (*path)(const bd_ale *ale, bd_ale_span *span, double h);
  /* After a rate: derivatives of an arc [law], of a span. 1 - g J: its factors, solutions. */
  void (*slopes[BD_N_LAWS])(const bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy,
                            const bd_ale_slopes *out);
  void (*answer)(const bd_ale *ale, int i, const bd_ale_state *y, const bd_ale_state *dy,
                 const bd_ale_moves *by, bd_ale_answers *out);
  void (*factor)(const bd_ale_ring *ring);
  void (*solve)(const bd_ale_ring *ring, double *x);
  /* Of n right-hand sides, `width` after one another; factors of these taken off x. */
  void (*solve_all)(const bd_ale_ring *ring, int n, int width, double *x);
  void (*deduct)(int unknowns, int n, int width, const double *columns, const double *factors,
                 double *x);
} bd_ale_kernels;

extern const bd_ale_kernels bd_ale_baseline;
#ifdef BD_X86_LEVELS
extern const bd_ale_kernels bd_ale_avx2, bd_ale_avx512;
#endif

/* X and A_n are taken between these shares of H0. */
#define BD_ALE_LEAST 0.02
#define BD_ALE_MOST 30.0

/* Of a span. */
static inline int bd_ale_unknowns(int along) {
  return along ? BD_ALE_OF_SPAN : BD_ALE_ALONG;
}

/* Of both ends' speeds what a wave along the span has with its own rate: 2 / pi. */
#define BD_ALE_SHARE 0.63661977236758134

/* As fmax and fmin, which compilers call: a, or the bound where a is beyond it or none. */
static inline double bd_at_least(double a, double least) {
  return a > least ? a : least;
}

static inline double bd_at_most(double a, double most) {
  return a < most ? a : most;
}

/* A table at a place counted in knots, its slope, and the slope of that. */
static inline double bd_ale_cubic(const double *value, const double *slope, double at, double *by,
                                  double *bends) {
  int i = (int)at;
  i = i < 0 ? 0 : i > BD_ALE_KNOTS - 2 ? BD_ALE_KNOTS - 2 : i;
  const double s = at - i, rise = value[i + 1] - value[i];
  const double b = 3.0 * rise - 2.0 * slope[i] - slope[i + 1],
               c = slope[i] + slope[i + 1] - 2.0 * rise;
  *by = slope[i] + s * (2.0 * b + 3.0 * s * c);
  *bends = 2.0 * b + 6.0 * s * c;
  return value[i] + s * (slope[i] + s * (b + s * c));
}

/* How belt of which an end lies on a pulley sinks in (MODEL section 11.3): with exp(-p x) (cos,
 * sin)(q x), cosh and sinh (`turns` -1) where bending is less than H^2 / 4c; and where it touches.
 */
typedef struct bd_ale_roots {
  double p, q, turns, touch;
} bd_ale_roots;

/* Under the force H, c = N / d. */
static inline bd_ale_roots bd_ale_roots_of(double EI, double H, double c) {
  if (!(EI > 0.0)) { /* a string: the slower exponential is all, whatever the other */
    const double slow = sqrt(c / H);
    return (bd_ale_roots){.p = 2.0 * slow, .q = slow, .turns = -1.0, .touch = -1.0 / slow};
  }
  const double square = 0.5 * sqrt(c / EI), along = 0.25 * H / EI, p = sqrt(square + along);
  return (bd_ale_roots){.p = p,
                        .q = sqrt(fmax(fabs(square - along), 1e-6 * square)),
                        .turns = square > along ? 1.0 : -1.0,
                        .touch = sqrt(EI / H) - p / square};
}

/* co (cos) + si (sin) times exp(-p x), or with cosh and sinh; its slope, and the integral of its
 * square. */
typedef struct bd_ale_fading {
  double co, si;
} bd_ale_fading;

static inline bd_ale_fading bd_ale_slope_of(const bd_ale_roots *roots, bd_ale_fading of) {
  const double p = roots->p, q = roots->q;
  return (bd_ale_fading){q * of.si - p * of.co, -roots->turns * q * of.co - p * of.si};
}

static inline double bd_ale_square_of(const bd_ale_roots *roots, bd_ale_fading of) {
  const double p = roots->p, q = roots->q, qq = roots->turns * q * q;
  return (of.co * of.co * (2.0 * p * p + qq) + 2.0 * of.co * of.si * p * q +
          of.si * of.si * q * q) /
         (4.0 * p * (p * p + qq));
}

/* Depth over that far from there, less 1. */
static inline bd_ale_fading bd_ale_sinks(const bd_ale_roots *roots) {
  const double p = roots->p, q = roots->q;
  return (bd_ale_fading){-1.0, (p + (p * p + roots->turns * q * q) * roots->touch) / q};
}

/* The integral of the square of the depth's slope, over the square of the depth. */
static inline double bd_ale_sloping(const bd_ale_roots *roots) {
  return bd_ale_square_of(roots, bd_ale_slope_of(roots, bd_ale_sinks(roots)));
}

static inline double bd_ale_slowest(const bd_ale_roots *roots) {
  return roots->turns > 0.0 ? roots->p : roots->p - roots->q;
}

/* cosh and sinh by themselves would overflow. */
static inline void bd_ale_fade(const bd_ale_roots *roots, double x, double *co, double *si) {
  const double p = roots->p, q = roots->q;
  if (roots->turns > 0.0) {
    const double fades = exp(-p * x);
    *co = fades * cos(q * x);
    *si = fades * sin(q * x);
  } else {
    const double slow = 0.5 * exp((q - p) * x), fast = 0.5 * exp(-(q + p) * x);
    *co = slow + fast;
    *si = slow - fast;
  }
}

/* What the contact of a cell stores per metre of stress-free belt. */
static inline double bd_ale_pressed(const bd_ale *ale, double depth) {
  const double sunk = bd_at_least(depth, 0.0);
  return ale->quadratic * sunk * sunk * sunk / 3.0 + 0.5 * ale->linear * depth * depth;
}

/* What weight does to the wave along a span, as a force on either end. */
static inline double bd_ale_hung_along(const bd_ale *ale, const bd_ale_span *span) {
  return 2.0 * span->along_inertia * (ale->gravity[0] * span->e[0] + ale->gravity[1] * span->e[1]);
}

/* lambda_n / k^2 less the force that presses the span. */
static inline double bd_ale_stiff(const bd_ale_span *span, int n, double pressing) {
  const bd_ale_waves *waves = span->waves;
  return waves->rises[n] * (pressing - waves->pressing) +
         waves->stiff[n] * span->wave[n] * span->wave[n];
}

/* By a mode the angle at an end, positive where belt is lifted. */
static inline double bd_ale_end_slope(const bd_ale_span *span, int end, int n) {
  return end == 0 || n % 2 == 0 ? span->wave[n] : -span->wave[n];
}

/* s R at an end. */
static inline double bd_ale_rolls_on(const bd_ale_span *span, int end) {
  return end == 0 ? span->rolls[0] : -span->rolls[1];
}

/* By how much the speed at which belt runs off a span's pulley (end 0), or on, goes with the rate
 * of mode n: as a wave turns the span there it rolls on the pulley. */
static inline double bd_ale_rolls(const bd_ale_span *span, int end, int n) {
  return span->rolls[end] * bd_ale_end_slope(span, end, n);
}

#endif
