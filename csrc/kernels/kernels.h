/* SPDX-License-Identifier: MIT
 *
 * The inner loops, compiled once per instruction level: what they work on and the tables of them.
 */
#ifndef BELTDYN_KERNELS_H
#define BELTDYN_KERNELS_H

#include "base/base.h"
#include "kernels/ale.h"

/* --- rate: rhs.h ----------------------------------------------------------------------------- */

/* Per-link constants, and the links' directions at the last evaluation. */
typedef struct bd_links {
  bd_layout lay;
  double half; /* l0 / 2 */
  double stiffness, damping, bending, bending_damping;
  double inv_mass, inv_inertia;
  double wind;             /* phi of link 0 seen from link n-1: 2 pi winding */
  const double *link_mask; /* 1 for links, 0 for the padding */
  double *cos, *sin;
  double *rx, *ry, *fx, *fy; /* scratch of jacobian.h */
} bd_links;

/* One pulley as the contact pass sees it. */
typedef struct bd_contact_pulley {
  double x, y, vx, vy; /* centre, relative to the origin, and its velocity */
  double radius, omega;
  double quadratic, linear, damping, hunt_crossley;
  double l0, bound;   /* of a link; of the friction state's magnitude after a step */
  int law, slot;      /* BD_LAW_..., BD_LAW_NONE: no friction; friction slot of its links */
  int states, stride; /* of friction, of a link; from one to the next in arrays of several */
  bd_friction friction;
} bd_contact_pulley;

/* The joints: means of the two ends that meet there, by the link on whose left they are,
 * (r_l + r_i) / 2 + l0 (e_l - e_i) / 4. */
typedef struct bd_points {
  double *x, *y, *vx, *vy;
} bd_points;

/* Contact integrated along the links (link_contact.h), of one pulley, by link: normal forces at its
 * two ends; what it has in contact of the halves that belong to the joints there, and the rate of
 * that. */
typedef struct bd_pressure {
  double *left, *right, *share_left, *share_right, *rate_left, *rate_right;
} bd_pressure;

/* Forces at the links' ends, and at the joints, of which both links have half. */
typedef struct bd_end_forces {
  double *left_x, *left_y, *right_x, *right_y, *joint_x, *joint_y;
} bd_end_forces;

typedef struct bd_run {
  int begin, end; /* links, multiples of BD_LANES */
} bd_run;

typedef struct bd_sums {
  double torque, contact_loss, friction_loss;
  double contact_energy; /* of add_normal_forces, where power is asked for */
  double force[2];       /* on the belt, of contact in one pass */
} bd_sums;

enum { BD_MAX_STAGES = 7, MAX_VECTORS = 8 };

struct bd_newton_kernels;

/* At one instruction level, of one belt model; what its belts do not need is NULL. */
typedef struct bd_kernels {
  const char *level;
  const struct bd_newton_kernels *newton;
  const bd_ale_kernels *ale; /* kernels/ale.h */
  /* Sets the link blocks of dy: velocities, joint accelerations, zero friction rates; returns the
   * power lost in the joints' dampers. Variants [bending][ledger]. */
  double (*joints[2][2])(const bd_links *links, const double *y, double *dy);
  /* Adds the contact in the runs with one pulley, of belts that have it in one pass: of the links'
   * centres, or of a string along its bars. Variants [law][ledger]. */
  void (*contact[BD_N_LAWS][2])(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                                const bd_run *runs, const double *y, double *dy, bd_sums *sums);
  /* Contact along the links. Directions of the links at y, into links->cos, sin, for all that
   * follows. Normal forces of one pulley [ledger]; the joints' positions and velocities, from a y
   * whose halo before link 0 is that of the last link; friction there [law][ledger], which adds its
   * sums. Forces to accelerations of the links. Squared distance of each link's nearer end. */
  void (*directions)(const bd_links *links, const double *y);
  void (*add_normal_forces[2])(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                               const bd_run *runs, const bd_pressure *pressure,
                               const bd_end_forces *out, const double *y, bd_sums *sums);
  void (*gather_points)(const bd_links *links, const double *co, const double *si, const double *y,
                        const bd_points *points);
  void (*add_friction[BD_N_LAWS][2])(const bd_links *links, const bd_contact_pulley *pulley,
                                     int n_runs, const bd_run *runs, const bd_points *points,
                                     const bd_pressure *pressure, const bd_end_forces *out,
                                     const double *y, double *dy, bd_sums *sums);
  void (*scatter_forces)(const bd_links *links, const double *co, const double *si,
                         const bd_end_forces *forces, double *dy);
  void (*nearest_ends)(const bd_links *links, const bd_contact_pulley *pulley, int n_runs,
                       const bd_run *runs, const double *y, double *nearest);
  /* Of the forces at links' ends and at joints in the runs, by axes. */
  void (*sum_forces)(int n_runs, const bd_run *runs, const bd_end_forces *forces, double out[2]);
  /* After a step, the first block of BD_LANES links in [begin, end) with a contact event: a link
   * that has come to this pulley or left it, whose friction state is to be reset or is out of
   * bounds, or that is half a radius deep; `end` if none. owner: of the pulley's slot; nearest: as
   * nearest_ends gave it. Variants [friction]. */
  int (*find_contact_event[2])(const bd_links *links, const bd_contact_pulley *pulley, int index,
                               const double *owner, const double *nearest, const double *y,
                               int begin, int end);
  /* An element of a friction law at one link; the law's bound, and the element's kinetic
   * coefficient. [law] */
  void (*law[BD_N_LAWS])(const bd_friction *friction, double l0, int element, double z, double v,
                         double normal, bd_law_point *out);
  double (*bound[BD_N_LAWS])(const bd_friction *friction);
  double (*kinetic[BD_N_LAWS])(const bd_friction *friction, int element);
  /* Largest squared speed of a link. */
  double (*fastest)(const bd_layout *lay, const double *y);
  /* out = y + h sum a[j] k[j], 1 to MAX_VECTORS vectors */
  void (*combine)(size_t n, double *out, const double *y, double h, int m, const double *a,
                  double *const *k);
  /* Largest w |h sum e[j] k[j]|, of as many, over links and pulleys, positions and velocities as
   * vectors, so that it does not depend on the axes; NaN becomes infinity. */
  double (*error_norm)(const bd_layout *lay, double h, int m, const double *e, double *const *k,
                       const double *w);
} bd_kernels;

/* Of the best level, or that which is asked for, by belt model; NULL: the processor lacks it. */
const bd_kernels *bd_kernels_choose(void);
extern const bd_kernels bd_kernels_baseline[BD_N_BELT_MODELS];

/* --- linear systems of the implicit methods: jacobian.h, ring.h ------------------------------ */

/* The joints as linearised, by link: direction, angular velocity, and the joints' pull along the
 * link over half its length. */
typedef struct bd_tangent {
  double *cos, *sin, *spin, *pull;
} bd_tangent;

/* A matrix of the ring: of nodes with this mass and inertia, which moves between neighbours and
 * turning ends (k), angular velocities (spin), angles (bend) and the joints' pull hold together,
 * and contact. By tiles of BD_LANES nodes: blocks that couple a node to the one before it, to
 * itself, and to the one ahead, each by rows. Of links that joints alone couple (at their centres,
 * mesh "paper") contact's entries xx, xy, yx, yy alone are stored, as fields at the layout's
 * stride. A link's unknown angle, times `arm`, is that of its end (half its length times phi). */
typedef struct bd_matrix {
  const bd_tangent *joints;
  double *tiles, mass, inertia, k, spin, bend, pull, arm;
  int stride;
} bd_matrix;

/* For one g: W = M - g F_v - g^2 F_q, which is solved, by angles of ends, and Q = g^2 F_q, by phi;
 * friction states eliminated. */
typedef struct bd_assembled {
  bd_matrix w, q;
} bd_assembled;

/* What a fill is for: the state y; g; and the step h that contact is seen at the end of, as long as
 * there is a rate c, to which is added what forces will be beyond their tangent. */
typedef struct bd_fill {
  const double *y;
  double g, h;
  double *c;
} bd_fill;

/* What it returns: the pulley's own entry of W; torque and force of what is beyond the tangent. */
typedef struct bd_fill_sums {
  double own, torque, force[2];
} bd_fill_sums;

enum { BD_END_ROWS = 16, BD_POINT_ROWS = 58 };

/* Shared by all pulleys: the joints where linearised; contact; of the segments' left and right ends
 * the normal force beyond its tangent, and rows by the columns of the segment; what stands with
 * points (contact_points.h). */
typedef struct bd_contact_scratch {
  bd_points points;
  bd_pressure pressure;
  double *correction[2], *end[2][BD_END_ROWS], *point[BD_POINT_ROWS];
} bd_contact_scratch;

/* What solves need of a pulley's contact, by point. Slip by the columns (of links' centres two) and
 * by the pulley's spin; states by slip and, where `others` is set, by the columns beside that,
 * times what the step does (decay: what it leaves of a given change); what a given state is worth.
 * Of links' centres forces by places. */
typedef struct bd_slot {
  double *sq[6], *sv[6], *rho, *zq[6], *zv[6], *by_slip, *others, *decay;
  double *given_x, *given_y, *given_torque, *held_x, *held_y;
} bd_slot;

/* A body in the border: its rows of W and of Q and its column, fields by node at the layout's
 * stride; of a mount the column of its given travel. */
typedef struct bd_body {
  double *w, *q, *column, *given;
} bd_body;

/* The axis of a pulley on a mount: it moves along a with the travel, and a turns with it by bend,
 * times g and the speed. */
typedef struct bd_axis {
  double a[2], bend[2];
  const bd_body *body;
} bd_axis;

/* The ring cut into arcs: row j of arc a is link base[a] + j. */
typedef struct bd_ring {
  int n, n_rows;
  int *base;
  double *shorter; /* 1: the arc's row 0 stands for no link */
  void *rows, *scratch, *ends;
} bd_ring;

/* Loops of solvers/newton_system.c at one instruction level. */
typedef struct bd_newton_kernels {
  int width;                  /* arcs */
  int unknowns;               /* of a link: 3, or 2 of a mass of a string */
  size_t ring_row, ring_ends; /* bytes: of a row of links, of the separators */
  void (*factor)(const bd_ring *ring, const bd_matrix *w);
  void (*solve)(const bd_ring *ring, double *const *v);
  void (*linearise_joints)(const bd_links *links, const double *y, const bd_tangent *tangent);
  void (*finish_nodes)(const bd_links *links, double g, int n_columns, const double *columns,
                       const double *factors, const double *x, const double *y, const double *p,
                       double *c);
  /* The ring without contact, stored; contact of a pulley, added [law]; products with given
   * vectors; rows of bodies; states of friction and slip. */
  void (*fill_ring)(const bd_layout *lay, const bd_matrix *out);
  bd_fill_sums (*fill_pulley[BD_N_LAWS])(const bd_links *links, const bd_tangent *tangent,
                                         const bd_contact_pulley *pulley, int n_runs,
                                         const bd_run *runs, const bd_fill *fill,
                                         const bd_contact_scratch *scratch, const bd_assembled *out,
                                         const bd_slot *slot, const bd_body *body,
                                         const bd_axis *axis);
  void (*blocks_product)(const bd_layout *lay, const bd_matrix *q, const double *cq,
                         const double *cv, const double *mass, double *const *r);
  void (*states_product)(const bd_layout *lay, const bd_tangent *tangent, int n_runs,
                         const bd_run *runs, int states, const bd_slot *slot, const double *cz,
                         const double *row, const double *cq, double *const *to, double *sums);
  double (*row_runs)(const bd_layout *lay, int n_runs, const bd_run *runs, const double *row,
                     const double *const *v);
  void (*add_column)(const bd_layout *lay, int n_runs, const bd_run *runs, const double *column,
                     double factor, double *const *r);
  void (*restore_states)(const bd_layout *lay, int n_runs, const bd_run *runs, int states,
                         const bd_slot *slot, const double *link_mask, double spin,
                         const double *move, const double *cq, const double *cv, double *cz,
                         double *cslip);
  double (*sum_runs)(int n_runs, const bd_run *runs, const double *array);
} bd_newton_kernels;

#endif
