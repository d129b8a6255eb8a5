/* SPDX-License-Identifier: MIT
 *
 * The inner loops, compiled once per instruction level: what they work on and the tables of them.
 */
#ifndef BELTDYN_KERNELS_H
#define BELTDYN_KERNELS_H

#include "base/base.h"

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
  double quadratic, linear, damping;
  double l0, bound; /* of a link; of the friction state's magnitude after a step */
  int law, slot;    /* BD_LAW_..., BD_LAW_NONE: no friction; friction slot of its links */
  bd_friction friction;
} bd_contact_pulley;

/* Where contact is, by link: links' centres, or the joints on their left. Point p of a joint is the
 * mean of the ends that meet there, (r_l + r_i) / 2 + l0 (e_l - e_i) / 4. */
typedef struct bd_points {
  double *x, *y, *vx, *vy;
} bd_points;

static inline bd_points bd_links_as_points(const bd_layout *lay, double *y) {
  return (bd_points){bd_field(lay, y, F_X), bd_field(lay, y, F_Y), bd_field(lay, y, F_VX),
                     bd_field(lay, y, F_VY)};
}

/* Where forces at points go: added, times per_mass. */
typedef struct bd_forces {
  double *x, *y, per_mass;
} bd_forces;

typedef struct bd_run {
  int begin, end; /* links, multiples of BD_LANES */
} bd_run;

typedef struct bd_sums {
  double torque, contact_loss, friction_loss;
} bd_sums;

enum { BD_MAX_STAGES = 7, MAX_VECTORS = 8 };

struct bd_newton_kernels;

typedef struct bd_kernels {
  const char *level;
  const struct bd_newton_kernels *newton;
  /* Sets the link blocks of dy: velocities, joint accelerations, zero friction rates; returns the
   * power lost in the joints' dampers. Variants [bending][ledger]. */
  double (*joints[2][2])(const bd_links *links, const double *y, double *dy);
  /* Adds the contact of one pulley with the points of the runs. Variants [law][ledger]. */
  void (*contact[BD_N_LAWS][2])(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                                const bd_run *runs, const bd_points *points, const bd_forces *out,
                                const double *y, double *dy, bd_sums *sums);
  /* Contact of joints. Directions of the links at y, into links->cos, sin; the joints' positions
   * and velocities, from directions and a y whose halo before link 0 is that of the last link;
   * forces at joints to accelerations of the links. */
  void (*directions)(const bd_links *links, const double *y);
  void (*gather_points)(const bd_links *links, const double *co, const double *si, const double *y,
                        const bd_points *points);
  void (*scatter_forces)(const bd_links *links, const double *co, const double *si,
                         const double *fx, const double *fy, double *dy);
  /* After a step, the first block of BD_LANES links in [begin, end) with a contact event: a link
   * that has come to this pulley or left it, whose friction state is to be reset or is out of
   * bounds, or that is half a radius deep; `end` if none. owner: of the pulley's slot. Variants
   * [friction].
   */
  int (*find_contact_event[2])(const bd_layout *lay, const bd_contact_pulley *pulley, int index,
                               const double *owner, const bd_points *points, const double *y,
                               int begin, int end);
  /* A friction law at one link; its bound and kinetic coefficient. [law] */
  void (*law[BD_N_LAWS])(const bd_friction *friction, double l0, double z, double v, double normal,
                         bd_law_point *out);
  double (*bound[BD_N_LAWS])(const bd_friction *friction);
  double (*kinetic[BD_N_LAWS])(const bd_friction *friction);
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

const bd_kernels *bd_kernels_choose(void);

/* --- linear systems of the implicit methods: jacobian.h, ring.h ------------------------------ */

/* One solve: g = gamma h, the mass of a link (mass-proportional damping included). */
typedef struct bd_stage {
  double g, mass;
  double slender; /* mass of a link over what its inertia is worth at its ends */
} bd_stage;

/* Blocks of the ring's matrix, by link; k, bending and damping are the joints'. */
typedef struct bd_blocks {
  double k, bending, damping;
  const double *cos, *sin, *spin;
  double *xx, *xy, *yx, *yy, *pp;
  /* Contact of joints, where `full`: the diagonal's xp, yp, px, py; and what couples a link to the
   * one before it, and that one to it, by rows. */
  double *xp, *yp, *px, *py, *back[9], *forward[9];
} bd_blocks;

/* Contact for one g, by point, added up over the pulleys: the force's part of the matrix; of joints
 * also what of that is by velocities alone, and the force itself. */
typedef struct bd_joint_blocks {
  double *xx, *xy, *yx, *yy, *vxx, *vxy, *vyx, *vyy, *fx, *fy, *turning;
} bd_joint_blocks;

/* The joints as linearised, by link: direction, angular velocity, and the joints' pull along the
 * link over half its length; for one g, what turning it does to the forces at its ends. */
typedef struct bd_tangent {
  double *cos, *sin, *spin, *pull, *end_x, *end_y;
} bd_tangent;

/* The contact of one pulley as linearised: arrays by link, valid in the runs of links near the
 * pulley, 0 where nothing touches. rho: distance of the link's centre from the axis; n, t: the
 * outward normal and the tangent there; p: penetration; v_n, v_t, v_T: normal, tangential and slip
 * velocity. */
typedef struct bd_contact_tangent {
  double *nx, *ny;           /* n */
  double *rho;               /* distance from the axis */
  double *normal;            /* N */
  double *normal_over_rho;   /* N / rho */
  double *mu;                /* friction coefficient F / N */
  double *by_normal;         /* dF/dN: mu unless the law is general */
  double *by_state;          /* dF/dz: N unless the law is general */
  double *by_slip;           /* dF/dv_T, of general laws */
  double *stiff, *damp;      /* dN/dp, dN/dp' */
  double *cross;             /* dN/dp' v_t / rho */
  double *apart;             /* v_n / rho */
  double *gain, *decay;      /* dz'/dv_T, -dz'/dz */
  double *gain_normal;       /* dz'/dN, of general laws */
  double *normal_correction; /* of N at the end of a step, beyond its tangent */
  /* For one g: */
  double *xx, *xy, *yx, *yy;     /* force by position */
  double *by_given_state;        /* force by the state of friction, along -t */
  double *torque_x, *torque_y;   /* torque on the pulley by position */
  double *row_x, *row_y;         /* the pulley's row of the border */
  double *row_vx, *row_vy;       /* of joints: its part by velocities alone, */
  double *vxx, *vxy, *vyx, *vyy; /* and the same of the force, of opposite sign */
  double *slide_x, *slide_y;     /* v_T by position */
  double *state_by_slip;         /* change of z by v_T, over the step */
  double *state_by_normal;       /* and by N, of general laws */
  double *decay_factor; /* what the step leaves of a given change of z: 1 / (1 + g decay) */
} bd_contact_tangent;

/* The ring cut into arcs: row j of arc a is link base[a] + j. */
typedef struct bd_ring {
  int n_rows;
  int *base;
  double *shorter; /* 1: the arc's row 0 stands for no link */
  void *rows, *scratch, *ends;
} bd_ring;

/* Loops of solvers/newton_system.c at one instruction level. */
typedef struct bd_newton_kernels {
  int width;                  /* arcs */
  size_t ring_row, ring_ends; /* bytes: of a row of links, of the separators */
  /* [1 where links are coupled by full blocks: contact of joints] */
  void (*factor[2])(const bd_ring *ring, const bd_blocks *blocks);
  void (*solve[2])(const bd_ring *ring, double k, double *x, double *y, double *p);
  void (*linearise_joints)(const bd_links *links, const double *y, const bd_tangent *tangent);
  void (*diagonal)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                   const bd_blocks *blocks);
  void (*joints_product)(const bd_links *links, const bd_tangent *tangent, const bd_stage *stage,
                         const double *c, double *x, double *y, double *p);
  void (*finish_links)(const bd_links *links, const bd_stage *stage, int n_columns,
                       const double *columns, const double *factors, const double *x,
                       const double *y, const double *p, double *c);
  /* Variants [law]; below [general] (friction/laws.h). */
  void (*linearise_contact[BD_N_LAWS])(const bd_links *links, const bd_contact_pulley *pulley,
                                       int n_runs, const bd_run *runs, const bd_points *points,
                                       const double *y, const bd_contact_tangent *contact,
                                       double h);
  double (*add_normal_correction[2])(const bd_layout *lay, const bd_contact_pulley *pulley,
                                     int n_runs, const bd_run *runs,
                                     const bd_contact_tangent *contact, const bd_forces *out,
                                     double *c);
  /* [general][of joints]; [of joints]. points: where `c` or the solution moves the points. */
  double (*add_contact[2][2])(const bd_contact_pulley *pulley, int n_runs, const bd_run *runs,
                              const bd_contact_tangent *contact, double g,
                              const bd_joint_blocks *blocks, double *column_x, double *column_y);
  double (*contact_product[2])(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                               const bd_run *runs, const bd_contact_tangent *contact, int friction,
                               double g, const bd_points *points, const double *c, double *x,
                               double *y);
  void (*finish_contact[2])(const bd_layout *lay, const bd_contact_pulley *pulley, int n_runs,
                            const bd_run *runs, const bd_contact_tangent *contact, double g,
                            double angular_acceleration, const bd_points *points, double *c);
  double (*border_row)(int n_runs, const bd_run *runs, const bd_contact_tangent *contact,
                       const double *x, const double *y);
  /* Contact of joints (points_jacobian.h). */
  void (*gather_points)(const bd_links *links, const bd_tangent *tangent, double *y,
                        const bd_points *points);
  void (*project)(const bd_links *links, const bd_tangent *tangent, double *c, int solved,
                  const bd_points *points);
  void (*assemble)(const bd_links *links, const bd_tangent *tangent, double g,
                   const bd_joint_blocks *joints, const bd_blocks *blocks);
  void (*to_links)(const bd_links *links, const bd_tangent *tangent, double *fx, double *fy,
                   double *x, double *y, double *p);
  void (*add_turning)(const bd_layout *lay, const bd_joint_blocks *joints, double g,
                      const double *c, double *p);
  void (*row_of_links)(const bd_links *links, const bd_tangent *tangent, double g, double *row_x,
                       double *row_y, double *row_vx, double *row_vy, double *x, double *y,
                       double *p);
  double (*ring_product)(const bd_layout *lay, const double *const row[3], const double *x,
                         const double *y, const double *p);
} bd_newton_kernels;

extern const bd_newton_kernels bd_newton_baseline;

#endif
