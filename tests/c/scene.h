/* SPDX-License-Identifier: MIT
 *
 * One drive for the C tests: the paper's, with everything switched on, and room for a state of it.
 */
#ifndef SCENE_H
#define SCENE_H

#include <math.h>

#include "beltdyn.h"

enum { N = 36, NP = 3 };

#ifndef TEST_MESH
#define TEST_MESH BD_MESH_PAPER
#endif

static const bd_pulley test_pulleys[NP] = {
    {.center = {0.0, 0.0}, .radius = 0.08, .inertia = 0.01, .drag = {0.02, 1e-3, 1e-5}},
    {.center = {0.16, 0.22}, .radius = 0.035, .inertia = 0.0015},
    {.center = {0.26, -0.04}, .radius = 0.06, .inertia = 0.001, .drag = {0.01, 0, 0}}};
static const bd_friction test_friction = {BD_LAW_dahl, {.dahl = {0.8, 1e4, 0.0, 0.0}}};

static inline bd_scene test_scene(void) {
  return (bd_scene){.belt = {1.1753, N, 0.1, 80e3, 3.0, 0.02, 1e-6, TEST_MESH, BD_BELT_AUTO},
                    .n_pulleys = NP,
                    .pulleys = test_pulleys,
                    .contact = {5e10, 5e7, 2e3, 0, 0.0},
                    .friction = &test_friction,
                    .gravity = {0.0, -9.81}};
}

typedef struct room {
  double links[8][N], pulleys[2][NP];
} room;

static inline bd_state state_in(room *r) {
  return (bd_state){.x = r->links[0],
                    .y = r->links[1],
                    .phi = r->links[2],
                    .vx = r->links[3],
                    .vy = r->links[4],
                    .vphi = r->links[5],
                    .mu = r->links[6],
                    .slip = r->links[7],
                    .theta = r->pulleys[0],
                    .omega = r->pulleys[1]};
}

static inline int finish(bd_sim *sim, bd_error *err) {
  int code;
  do {
    code = bd_sim_advance(sim, 100, err);
  } while (code == BD_MORE);
  return code;
}

static inline int come_to_rest(bd_settling *settling, bd_error *err) {
  int code;
  do {
    code = bd_settle_advance(settling, 100, err);
  } while (code == BD_MORE);
  return code;
}

/* Settles the drive into `state`; a negative code if anything fails on the way. */
static inline int settle_into(const bd_model *model, bd_state *state, bd_error *err) {
  bd_settling *settling = NULL;
  bd_settle_options options;
  bd_settle_options_default(&options);
  options.friction = 1;
  int code = bd_settle_create(&settling, model, NULL, &options, err);
  if (code == BD_OK) {
    code = come_to_rest(settling, err);
  }
  if (code == BD_OK) {
    bd_sim_state(bd_settle_sim(settling), state);
  }
  bd_settle_free(settling);
  return code;
}

/* The drive, settled into the room; NULL if anything fails on the way. */
static inline bd_model *settled_drive(bd_state *state) {
  bd_model *model = NULL;
  bd_scene scene = test_scene();
  if (bd_model_create(&model, &scene, NULL) == BD_OK && settle_into(model, state, NULL) != BD_OK) {
    bd_model_free(model);
    model = NULL;
  }
  return model;
}

#endif
