/* SPDX-License-Identifier: MIT
 *
 * The public C interface, used as a C program would; built with sanitizers by tests/test_c.py.
 */
#include <stdlib.h>

#include "base/base.h"
#include "check.h"
#include "scene.h"

static void errors_have_names(void) {
#define X(symbol, kind, text)                                                                      \
  CHECK(strcmp(bd_error_symbol(symbol), #symbol) == 0);                                            \
  CHECK(strcmp(bd_error_text(symbol), text) == 0);                                                 \
  CHECK(bd_error_kind(symbol) == BD_KIND_##kind);                                                  \
  CHECK(symbol < 0);
  BD_ERRORS(X)
#undef X
  CHECK(strcmp(bd_error_symbol(BD_OK), "BD_OK") == 0);
  CHECK(strcmp(bd_error_symbol(12345), "unknown") == 0);
}

static const bd_pulley overlapping_pulleys[] = {{.center = {0, 0}, .radius = 0.1, .inertia = 1},
                                                {.center = {0.1, 0}, .radius = 0.1, .inertia = 1}};

static void refused(const bd_scene *scene, const char *field, int line) {
  bd_model *model = NULL;
  bd_error err;
  int code = bd_model_create(&model, scene, &err);
  if (code == BD_OK) {
    code = bd_model_check_geometry(model, &err);
  }
  if (code >= 0 || strcmp(err.field, field) != 0 || err.message[0] == 0 || err.code != code) {
    ++failures;
    printf("line %d: expected %s refused, got %d %s: %s\n", line, field, code, err.field,
           err.message);
  }
  bd_model_free(model);
  CHECK(bd_model_create(&model, scene, NULL) <= 0); /* no error wanted: no crash */
  bd_model_free(model);
}

static void bad_scenes_are_refused(void) {
  const double bad[] = {0.0, -1.0, (double)NAN, (double)INFINITY};
  for (int k = 0; k < 4; ++k) {
    bd_pulley pulleys[NP];
    bd_friction friction = test_friction;
    memcpy(pulleys, test_pulleys, sizeof pulleys);
    bd_scene scene = test_scene();
    scene.pulleys = pulleys;
    scene.friction = &friction;
#define BREAK(place, field)                                                                        \
  do {                                                                                             \
    double kept = place;                                                                           \
    place = bad[k];                                                                                \
    refused(&scene, field, __LINE__);                                                              \
    place = kept;                                                                                  \
  } while (0)
    BREAK(scene.belt.length, "belt.length");
    BREAK(scene.belt.linear_density, "belt.linear_density");
    BREAK(scene.belt.axial_stiffness, "belt.axial_stiffness");
    BREAK(pulleys[1].radius, "pulleys[1].radius");
    BREAK(pulleys[2].inertia, "pulleys[2].inertia");
    BREAK(friction.dahl.mu_k, "friction.mu_k");
    BREAK(friction.dahl.sigma, "friction.sigma");
    if (k > 0) {
      BREAK(scene.belt.axial_damping, "belt.axial_damping");
      BREAK(scene.belt.bending_stiffness, "belt.bending_stiffness");
      BREAK(scene.belt.bending_damping, "belt.bending_damping");
      BREAK(scene.contact.quadratic, "contact.quadratic");
      BREAK(scene.contact.linear, "contact.linear");
      BREAK(scene.contact.damping, "contact.damping");
    }
    if (k > 1) {
      BREAK(scene.gravity[0], "gravity.x");
      BREAK(scene.gravity[1], "gravity.y");
      BREAK(pulleys[0].center[0], "pulleys[0].center.x");
      BREAK(pulleys[2].center[1], "pulleys[2].center.y");
    }
  }
  bd_scene scene = test_scene();
  scene.belt.n_bodies = 2;
  refused(&scene, "belt.n_bodies", __LINE__);
  scene = test_scene();
  scene.n_pulleys = 0;
  refused(&scene, "pulleys", __LINE__);
  scene = test_scene();
  scene.belt.length = 1.3;
  refused(&scene, "belt.length", __LINE__);
  scene.belt.length = 0.5;
  refused(&scene, "belt.length", __LINE__);
  scene = test_scene();
  scene.n_pulleys = 2;
  scene.pulleys = overlapping_pulleys;
  refused(&scene, "pulleys", __LINE__);
  const bd_pulley inside[] = {{.center = {0, 0}, .radius = 0.1, .inertia = 1},
                              {.center = {0.5, 0}, .radius = 0.1, .inertia = 1},
                              {.center = {0.25, -0.02}, .radius = 0.05, .inertia = 1}};
  scene.n_pulleys = 3;
  scene.pulleys = inside;
  refused(&scene, "pulleys", __LINE__);
}

static void set_number(void *place, double value) {
  *(double *)place = value;
}

/* The last of two numbers. */
static void set_list(void *place, double value) {
  *(bd_numbers *)place = (bd_numbers){2, {0.25, value}};
}

#define SET(field, value)                                                                          \
  _Generic(field, double : set_number, bd_numbers : set_list)(&(field), value)

/* Every number of a law is 0.5, of lists 0.25 and 0.25. */
static bd_friction some_friction(int law) {
  bd_friction friction = {.law = law};
  switch (law) {
#define X(group, name, rule, unit, text)                                                           \
  SET(friction.group.name, strcmp(#rule, "POSITIVES") == 0 ? 0.25 : 0.5);
#define LAW(name, class, general, states, text)                                                    \
  case BD_LAW_##name:                                                                              \
    BD_LAW_##name(X) break;
    BD_LAWS(LAW)
#undef LAW
#undef X
  }
  return friction;
}

static void bad_friction_is_refused(void) {
  bd_pulley pulleys[NP];
  bd_friction friction = test_friction, own = test_friction;
  bd_scene scene = test_scene();
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  scene.pulleys = pulleys;
  scene.friction = &friction;
  pulleys[2].friction = &own;
  const int unknown[] = {BD_N_LAWS, -1, 1000};
  for (int k = 0; k < 3; ++k) {
    friction.law = unknown[k];
    refused(&scene, "friction", __LINE__);
    friction = test_friction;
    own.law = unknown[k];
    refused(&scene, "pulleys[2].friction", __LINE__);
    own = test_friction;
  }
  const double bad[] = {-1.0, (double)NAN, (double)INFINITY, 0.0};
  for (int k = 0; k < 4; ++k) {
#define X(group, name, rule, unit, text)                                                           \
  if (k < 3 || strncmp(#rule, "POSITIVE", 8) == 0) {                                               \
    friction = some_friction(BD_LAW_##group);                                                      \
    SET(friction.group.name, bad[k]);                                                              \
    refused(&scene, "friction." #name, __LINE__);                                                  \
    own = friction;                                                                                \
    friction = test_friction;                                                                      \
    refused(&scene, "pulleys[2].friction." #name, __LINE__);                                       \
    own = test_friction;                                                                           \
  }
#define LAW(name, class, general, states, text) BD_LAW_##name(X)
    BD_LAWS(LAW)
#undef LAW
#undef X
  }
}

static void each_pulley_has_its_friction(void) {
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model = NULL;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  scene.pulleys = pulleys;
  for (int law = BD_LAW_NONE + 1; law < BD_N_LAWS; ++law) {
    const bd_friction own = some_friction(law);
    double kinetic, slip;
    pulleys[1].friction = &own;
    for (int shared = 0; shared < 2; ++shared) {
      scene.friction = shared ? &test_friction : NULL;
      CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
      CHECK(bd_model_friction(model, 1, &kinetic, &slip) == law);
      CHECK(kinetic == 0.5 && isfinite(slip));
      CHECK(bd_friction_states(&own) > 0 ? slip > 0.0 : slip == 0.0);
      CHECK(bd_model_friction(model, 0, &kinetic, &slip) == (shared ? BD_LAW_dahl : BD_LAW_NONE));
      CHECK(shared ? kinetic == 0.8 && fabs(slip - 0.8 / 1e4) < 1e-18
                   : kinetic == 0.0 && isinf(slip));
      bd_model_free(model);
    }
  }
}

static void pulleys_have_names(void) {
  char long_name[BD_MAX_NAME + 2] = {0}, own[] = "idler";
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model;
  bd_error err;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  memset(long_name, 'x', sizeof long_name - 1);
  scene.pulleys = pulleys;
  const char *const bad[] = {"", "a\nb", "a\177", long_name};
  for (int k = 0; k < 4; ++k) {
    pulleys[1].name = bad[k];
    refused(&scene, "pulleys[1].name", __LINE__);
  }
  long_name[BD_MAX_NAME] = 0;
  pulleys[0].name = pulleys[1].name = long_name;
  refused(&scene, "pulleys[1].name", __LINE__);
  pulleys[1].name = own;
  CHECK(bd_model_create(&model, &scene, &err) == BD_OK);
  own[0] = 'X'; /* names are copied */
  CHECK(strncmp(bd_pulley_label(model, 0).text, "pulley \"xxx", 11) == 0);
  CHECK(strlen(bd_pulley_label(model, 0).text) == BD_MAX_NAME + 9);
  CHECK(strcmp(bd_pulley_label(model, 1).text, "pulley \"idler\"") == 0);
  CHECK(strcmp(bd_pulley_label(model, 2).text, "pulley 2") == 0);
  CHECK(strcmp(bd_pulley_label(model, NP).text, "pulley 3") == 0);
  CHECK(strcmp(bd_pulley_label(model, -1).text, "pulley -1") == 0);
  bd_model_free(model);
}

/* What does not fit into a message is cut off between two characters of UTF-8. */
static void messages_are_cut_between_characters(void) {
  bd_error err;
  char text[2 * sizeof err.message];
  for (size_t k = 0; k < 4; ++k) {
    memset(text, 'x', k);
    for (size_t n = k; n + 3 < sizeof text; n += 3) {
      memcpy(text + n, "\xe3\x83\x9d", 4);
    }
    bd_fail(&err, BD_ERR_OPTION, "text", "%s", text);
    const size_t length = strlen(err.message);
    CHECK(length % 3 == k % 3 && length > sizeof err.message - 7);
    CHECK(strncmp(err.message, text, length) == 0);
  }
}

static void laws_are_evaluated(void) {
  bd_law_point p;
  bd_error err;
  for (int law = BD_LAW_NONE + 1; law < BD_N_LAWS; ++law) {
    const bd_friction friction = some_friction(law);
    CHECK(bd_friction_evaluate(&friction, 0.02, 0, 0.0, 0.1, 100.0, &p, &err) == BD_OK);
    CHECK(p.force >= 0.0 && isfinite(p.force) && isfinite(p.rate));
    CHECK(bd_friction_states(&friction) > 0 ? p.rate > 0.0 : p.rate == 0.0);
    CHECK(bd_friction_evaluate(&friction, 0.0, 0, 0.0, 0.1, 100.0, &p, &err) == BD_ERR_OPTION);
    CHECK(bd_friction_evaluate(&friction, 0.02, 0, (double)NAN, 0.1, 1.0, &p, &err) < 0);
    CHECK(bd_friction_evaluate(&friction, 0.02, 0, 0.0, (double)INFINITY, 1.0, &p, &err) < 0);
    CHECK(bd_friction_evaluate(&friction, 0.02, 0, 0.0, 0.1, -1.0, &p, &err) < 0);
  }
  const bd_friction none = {.law = BD_LAW_NONE};
  CHECK(bd_friction_evaluate(&none, 0.02, 0, 0.0, 0.1, 1.0, &p, &err) == BD_ERR_PARAMETER);
  CHECK(strcmp(err.field, "friction") == 0);
}

static void belt_lines_have_their_lengths(void) {
  const bd_pulley equal[] = {{.center = {0, 0}, .radius = 0.1, .inertia = 1},
                             {.center = {0.29, 0}, .radius = 0.1, .inertia = 1}};
  const bd_pulley unequal[] = {{.center = {0, 0}, .radius = 0.06, .inertia = 1},
                               {.center = {0.35, 0}, .radius = 0.12, .inertia = 1}};
  bd_scene scene = test_scene();
  bd_model *model = NULL;
  bd_info info;
  scene.n_pulleys = 2;
  scene.pulleys = equal;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  bd_model_info(model, &info);
  CHECK(fabs(info.path_length - (2 * 0.29 + 2 * acos(-1.0) * 0.1)) < 1e-14);
  CHECK(info.winding == -1);
  bd_model_free(model);
  scene.pulleys = unequal;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  bd_model_info(model, &info);
  double tilt = asin(0.06 / 0.35);
  double exact =
      2 * 0.35 * cos(tilt) + 0.06 * (acos(-1.0) - 2 * tilt) + 0.12 * (acos(-1.0) + 2 * tilt);
  CHECK(fabs(info.path_length - exact) < 1e-14);
  bd_model_free(model);
  const double apart = hypot(0.35, 0.05), lean = asin((0.06 + 0.1) / apart);
  const bd_pulley crossed[] = {{.center = {0, 0}, .radius = 0.06, .inertia = 1},
                               {.center = {0.35, 0.05}, .radius = 0.1, .inertia = 1, .outside = 1}};
  bd_wrap wraps[2];
  double length;
  int turns;
  CHECK(bd_belt_line(2, crossed, wraps, &length, &turns, NULL) == BD_OK);
  CHECK(fabs(length - 2 * apart * cos(lean) - (0.06 + 0.1) * (acos(-1.0) + 2 * lean)) < 1e-14);
  CHECK(turns == 0 && wraps[0].sense == -1 && wraps[1].sense == 1);
  CHECK(fabs(wraps[1].wrap - acos(-1.0) - 2 * lean) < 1e-14);
  CHECK(fabs(wraps[0].span - apart * cos(lean)) < 1e-14);
  CHECK(bd_belt_line(2, overlapping_pulleys, wraps, &length, &turns, NULL) == BD_ERR_GEOMETRY);
  const bd_pulley single[] = {{.center = {3, 4}, .radius = 0.1, .inertia = 1}};
  scene.pulleys = single;
  scene.n_pulleys = 1;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  bd_model_info(model, &info);
  CHECK(fabs(info.path_length - 2 * acos(-1.0) * 0.1) < 1e-14);
  bd_model_free(model);
}

static void settles_and_runs(void) {
  static room r, r2;
  bd_error err;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  for (int i = 0; i < N; ++i) {
    CHECK(state.vx[i] == 0.0 && state.vy[i] == 0.0 && state.vphi[i] == 0.0);
  }

  const double t[] = {0.0, 1e-3, 1e-3, 2e-3};
  const double values[4][NP] = {{0}, {-5, 1, 0}, {-10, 1, 0}, {0}}, drag[NP] = {0.1, 0.2, 0.3};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 4, .t = t, .values = values[0]},
      {.kind = BD_TORQUE_VISCOUS, .coefficients = drag}};
  const double more[] = {0.5e-3};
  const bd_torque torque = {.n_terms = 2, .terms = terms, .n_breakpoints = 1, .breakpoints = more};
  enum { SAMPLES = 7 };
  double times[SAMPLES] = {0, 0.3e-3, 0.5e-3, 1e-3, 1e-3, 2.5e-3, 3e-3};
  static double rows[24][SAMPLES * N];
  static double energy[SAMPLES * BD_N_ENERGY];
  static int32_t touched[SAMPLES * N];
  bd_output out = {.pulley = touched};
  int k = 0;
#define X(name, group, size, unit, text) out.name = rows[k++];
  BD_OUTPUTS(X)
#undef X
  out.energy = energy;

  bd_sim *sim = NULL;
  bd_options options;
  bd_options_default(&options);
  options.method = "tsit5";
  options.rtol = 1e-7; /* of stretches of 1e-4 m: a hundredth of what is asked of places below, for
                          errors add up */
  CHECK(bd_sim_create(&sim, model, &state, &torque, 3e-3, &options, &err) == BD_OK);
  times[6] = 4e-3;
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_ERR_OPTION);
  times[6] = 3e-3;
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_OK);
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_ERR_BUSY);
  CHECK(bd_sim_advance(sim, 1, &err) == BD_MORE);
  CHECK(bd_sim_samples(sim) == 1);
  CHECK(finish(sim, &err) == BD_OK);
  CHECK(bd_sim_advance(sim, 1, &err) == BD_OK); /* at the end: stays there */
  CHECK(bd_sim_samples(sim) == SAMPLES);
  CHECK(bd_sim_time(sim) == 3e-3);
  bd_stats stats;
  bd_sim_stats(sim, &stats);
  CHECK(stats.steps > 10 && stats.nfev >= 6 * stats.steps);
  CHECK(bd_sim_pass(sim, 0) != NULL && bd_sim_pass(sim, 99) == NULL &&
        bd_sim_pass(sim, -1) == NULL);
  CHECK(strcmp(bd_sim_method(sim), "tsit5") == 0);
  bd_state end = state_in(&r2);
  bd_sim_state(sim, &end);
  CHECK(memcmp(end.x, out.x + 6 * N, N * sizeof(double)) == 0);
  CHECK(end.omega[0] != 0.0);
  CHECK(out.torque[3 * NP] == -5.0 - 0.1 * out.omega[3 * NP]); /* before the jump */
  for (int i = 0; i < SAMPLES * N; ++i) {
    CHECK(touched[i] >= -1 && touched[i] < NP);
    CHECK(out.normal[i] >= 0.0 && fabs(out.mu[i]) <= 0.8);
  }
  bd_sim_free(sim);

  /* each array alone is what it is among all */
  static double alone[SAMPLES * N];
  const bd_output one = {.mu = alone};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 3e-3, &options, &err) == BD_OK);
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &one, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_OK);
  CHECK(memcmp(alone, out.mu, sizeof alone) == 0);
  bd_sim_free(sim);

  /* the fixed-step method reaches the same place */
  options.method = "rk4";
  options.step = 1e-6;
  CHECK(bd_sim_create(&sim, model, &state, &torque, 3e-3, &options, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_OK);
  static room r3;
  bd_state again = state_in(&r3);
  bd_sim_state(sim, &again);
  for (int i = 0; i < N; ++i) {
    CHECK(fabs(again.x[i] - end.x[i]) < 1e-9);
  }
  bd_sim_free(sim);
  bd_model_free(model);
}

static void bad_runs_are_refused(void) {
  static room r;
  bd_error err;
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  bd_options options;
  bd_options_default(&options);
  CHECK(bd_sim_create(&sim, model, &state, NULL, 0.0, NULL, &err) == BD_ERR_OPTION && !sim);
  CHECK(bd_sim_create(&sim, model, &state, NULL, (double)NAN, NULL, &err) == BD_ERR_OPTION);
  options.method = "euler";
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1.0, &options, &err) == BD_ERR_OPTION);
  CHECK(strstr(err.message, "euler") != NULL);
  bd_options_default(&options);
  options.rtol = 0.0;
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1.0, &options, &err) == BD_ERR_OPTION);
  const double backwards[] = {1.0, 0.0}, zero[2 * NP] = {0}, nan3[NP] = {0, (double)NAN, 0};
  const bd_torque_term bad[] = {
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = backwards, .values = zero},
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = zero, .values = nan3},
      {.kind = BD_TORQUE_VISCOUS, .coefficients = nan3},
      {.kind = BD_TORQUE_FUNCTION},
      {.kind = BD_TORQUE_CALL},
      {.kind = BD_TORQUE_LOAD, .pulley = NP},
      {.kind = BD_TORQUE_LOAD, .pulley = -1},
      {.kind = BD_TORQUE_LOAD, .against = {.coulomb = -1.0}},
      {.kind = BD_TORQUE_LOAD, .against = {.quadratic = (double)NAN}},
      {.kind = BD_TORQUE_LOAD, .n_t = 2, .t = backwards, .values = zero},
      {.kind = BD_TORQUE_LOAD, .n_t = 2, .t = zero, .values = nan3},
      {.kind = BD_TORQUE_TABLE},
      {.kind = BD_TORQUE_TABLE, .n_points = 2, .omega = backwards, .torque = zero},
      {.kind = BD_TORQUE_TABLE, .n_points = 2, .omega = zero, .torque = zero},
      {.kind = BD_TORQUE_TABLE, .n_points = 1, .omega = zero, .torque = nan3 + 1},
      {.kind = BD_TORQUE_HARMONICS},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {1, zero, zero, zero}},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {1, backwards, nan3 + 1, zero}},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {1, backwards, zero, nan3 + 1}},
      {.kind = BD_TORQUE_HARMONICS, .of = NP, .harmonics = {1, backwards, zero, zero}},
      {.kind = 77},
  };
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    const bd_torque torque = {.n_terms = 1, .terms = &bad[k]};
    CHECK(bd_sim_create(&sim, model, &state, &torque, 1.0, NULL, &err) == BD_ERR_TORQUE_DATA);
    CHECK(sim == NULL);
  }
  state.vphi[7] = (double)NAN;
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1.0, NULL, &err) == BD_ERR_STATE);
  CHECK(err.body == 7 && strcmp(err.field, "vphi") == 0);
  state.vphi[7] = 0.0;
  state.mu[3] = 2.0;
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1.0, NULL, &err) == BD_ERR_STATE);
  bd_model_free(model);
}

static int stop_later(double t, const double *theta, const double *omega, double *torque,
                      void *user) {
  (void)theta, (void)omega;
  torque[0] = -1.0;
  if (user && t > 1e-4) {
    return 42;
  }
  return 0;
}

static void turn_bad(double t, const double *theta, const double *omega, double *torque,
                     void *user) {
  (void)theta, (void)omega, (void)user;
  torque[1] = t > 1e-4 ? (double)NAN : 0.0;
}

typedef struct reentry {
  bd_sim *sim;
  int seen;
} reentry;

static int enter_again(double t, const double *theta, const double *omega, double *torque,
                       void *user) {
  (void)t, (void)theta, (void)omega, (void)torque;
  reentry *r = user;
  bd_error err;
  r->seen = bd_sim_advance(r->sim, 1, &err);
  return 0;
}

static void torque_functions_are_heard(void) {
  static room r;
  bd_error err;
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  bd_torque_term term = {.kind = BD_TORQUE_CALL, .call = stop_later, .user = &r};
  bd_torque torque = {.n_terms = 1, .terms = &term};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-2, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_ERR_CALLBACK);
  CHECK(bd_sim_time(sim) <= 1e-4 && bd_sim_time(sim) > 0.0);
  CHECK(bd_sim_advance(sim, 1, &err) == BD_ERR_CALLBACK); /* the error stays */
  bd_sim_free(sim);

  term = (bd_torque_term){.kind = BD_TORQUE_FUNCTION, .function = turn_bad};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-2, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_ERR_TORQUE_VALUE);
  CHECK(err.pulley == 1 && err.t > 1e-4 && bd_sim_time(sim) <= 1e-4);
  bd_sim_free(sim);

  reentry inner = {0};
  term = (bd_torque_term){.kind = BD_TORQUE_CALL, .call = enter_again, .user = &inner};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-5, NULL, &err) == BD_OK);
  inner.sim = sim;
  CHECK(finish(sim, &err) == BD_OK);
  CHECK(inner.seen == BD_ERR_BUSY);
  bd_sim_free(sim);
  bd_model_free(model);
}

static int swing(double t, double *value, void *user) {
  const double *limits = user; /* of the times that it may be called for */
  CHECK(t >= limits[0] && t <= limits[1]);
  *value = t > limits[2] ? (double)NAN : 0.01 * (1.0 - cos(200.0 * t));
  return t > limits[3] ? 7 : 0;
}

/* Every kind of load under every kind of method: what is reported is their sum. */
static void loads(void) {
  static room r;
  bd_error err;
  const double t[] = {0.0, 1e-3, 1e-3}, factor[] = {0.0, 1.0, 0.5};
  const double speeds[] = {0.5, 1.0, 4.0}, torques[] = {0.2, 1.0, 3.0};
  const double orders[] = {2.0, 3.5}, amplitudes[] = {30.0, 5.0}, phases[] = {0.3, -1.0};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_LOAD, .pulley = 1, .against = {0.1, 0.2, 0.3}},
      {.kind = BD_TORQUE_TABLE,
       .pulley = 2,
       .n_points = 3,
       .omega = speeds,
       .torque = torques,
       .n_t = 3,
       .t = t,
       .values = factor},
      {.kind = BD_TORQUE_HARMONICS, .of = 1, .harmonics = {2, orders, amplitudes, phases}}};
  const bd_torque torque = {.n_terms = 3, .terms = terms};
  const char *const methods[] = {"tsit5", "rk4", "rodas4", "lbdf2", "lie", "auto"};
  const double end[] = {2e-3};
  double omega[NP], theta[NP], found[NP];
  const bd_output out = {.omega = omega, .theta = theta, .torque = found};
  bd_options options;
  bd_options_default(&options);
  for (int k = 0; k < 6; ++k) {
    bd_sim *sim = NULL;
    bd_state state = state_in(&r);
    bd_model *model = settled_drive(&state);
    bd_info info;
    CHECK(model != NULL);
    bd_model_info(model, &info);
    options.method = methods[k];
    options.rtol = 1e-3;
    CHECK(bd_sim_create(&sim, model, &state, &torque, end[0], &options, &err) == BD_OK);
    CHECK(bd_sim_set_output(sim, 1, end, &out, &err) == BD_OK);
    CHECK(finish(sim, &err) == BD_OK);
    double harmonics = 0.0, w = omega[1], w0 = info.drag_speed / test_pulleys[1].radius;
    for (int i = 0; i < 2; ++i) {
      harmonics += amplitudes[i] * cos(orders[i] * theta[1] + phases[i]);
    }
    CHECK(fabs(found[0] - harmonics) < 1e-12 * 35.0);
    CHECK(fabs(found[1] + 0.1 * w / sqrt(w * w + w0 * w0) + (0.2 + 0.3 * fabs(w)) * w) < 1e-12);
    w = omega[2], w0 = info.drag_speed / test_pulleys[2].radius;
    CHECK(fabs(w) > 0.0);
    const double size = fabs(w) < 0.5   ? 0.2
                        : fabs(w) < 1.0 ? 0.2 + 1.6 * (fabs(w) - 0.5)
                        : fabs(w) < 4.0 ? 1.0 + 2.0 / 3.0 * (fabs(w) - 1.0)
                                        : 3.0;
    CHECK(fabs(found[2] + 0.5 * size * w / sqrt(w * w + w0 * w0)) < 1e-12);
    bd_sim_free(sim);
    bd_model_free(model);
  }
}

static void prescribed_motions(void) {
  static room r;
  bd_error err;
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  const double up[] = {0.0, 1e-3}, back[] = {1e-3, 0.0}, twice[] = {0.0, 0.0};
  const double speed[] = {0.0, -2.0}, bad_speed[] = {0.0, (double)NAN}, fast[] = {-1.0, -2.0};
  const bd_motion bad[] = {
      {.pulley = 0, .kind = BD_MOTION_PIECEWISE, .n_t = 2, .t = back, .values = speed},
      {.pulley = 0, .kind = BD_MOTION_PIECEWISE, .n_t = 2, .t = twice, .values = speed},
      {.pulley = 0, .kind = BD_MOTION_PIECEWISE, .n_t = 2, .t = up, .values = bad_speed},
      {.pulley = 0, .kind = BD_MOTION_PIECEWISE},
      {.pulley = NP, .kind = BD_MOTION_SPEED, .call = swing},
      {.pulley = -1, .kind = BD_MOTION_SPEED, .call = swing},
      {.pulley = 0, .kind = BD_MOTION_ANGLE},
      {.pulley = 0, .kind = 77, .call = swing},
      {.kind = BD_MOTION_ANGLE, .call = swing, .harmonics = {1, up + 1, fast, fast}},
      {.n_t = 2, .t = up, .values = speed, .harmonics = {1, speed, speed, speed}},
      {.n_t = 2, .t = up, .values = speed, .fade = {1.0, 0.0}},
      {.n_t = 2, .t = up, .values = speed, .fade = {0.0, INFINITY}},
  };
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    const bd_torque torque = {.n_motions = 1, .motions = &bad[k]};
    CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-3, NULL, &err) == BD_ERR_TORQUE_DATA);
    CHECK(sim == NULL && strcmp(err.field, "motion") == 0);
  }
  const bd_motion at_speed = {
      .pulley = 2, .kind = BD_MOTION_PIECEWISE, .n_t = 2, .t = up, .values = fast};
  bd_torque torque = {.n_motions = 1, .motions = &at_speed};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-3, NULL, &err) == BD_ERR_STATE);
  CHECK(sim == NULL && err.pulley == 2 && err.value == -1.0);

  double limits[] = {0.0, 2e-3, INFINITY, INFINITY};
  const bd_motion moves[] = {
      {.pulley = 2, .kind = BD_MOTION_PIECEWISE, .n_t = 2, .t = up, .values = speed},
      {.pulley = 0, .kind = BD_MOTION_ANGLE, .call = swing, .user = limits},
  };
  torque = (bd_torque){.n_motions = 2, .motions = moves};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_OK);
  bd_sim_state(sim, &state);
  CHECK(state.omega[2] == -2.0 && fabs(state.theta[2] + 3e-3) < 1e-15);
  CHECK(fabs(state.theta[0] - 0.01 * (1.0 - cos(0.4))) < 1e-15);
  CHECK(fabs(state.omega[0] - 2.0 * sin(0.4)) < 1e-9);
  bd_sim_free(sim);
  state = state_in(&r);
  bd_model_free(model);
  model = settled_drive(&state);
  limits[3] = 1e-3;
  CHECK(bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_ERR_CALLBACK && err.pulley == 0);
  bd_sim_free(sim);
  limits[2] = 1e-3;
  limits[3] = INFINITY;
  CHECK(bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_ERR_TORQUE_VALUE && err.pulley == 0);
  bd_sim_free(sim);
  const double order = 3.0, amplitude = 0.01, phase = 0.4;
  const bd_motion crank = {.pulley = 2,
                           .n_t = 2,
                           .t = up,
                           .values = speed,
                           .harmonics = {1, &order, &amplitude, &phase}};
  torque = (bd_torque){.n_motions = 1, .motions = &crank};
  CHECK(bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_OK);
  bd_sim_state(sim, &state);
  CHECK(fabs(state.theta[2] + 3e-3 - amplitude * (cos(-9e-3 + phase) - cos(phase))) < 1e-15);
  CHECK(fabs(state.omega[2] + 2.0 * (1.0 - order * amplitude * sin(-9e-3 + phase))) < 1e-14);
  bd_sim_free(sim);
  bd_model_free(model);
}

static void rates_leave_no_trace(void) {
  static room r, r2;
  bd_error err;
  bd_state state = state_in(&r), rate = state_in(&r2);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  const double torque[NP] = {1.0, 0.0, -1.0};
  CHECK(bd_model_rate(model, &state, torque, &rate, &err) == BD_OK);
  CHECK(fabs(rate.omega[0] - (1.0 / 0.01 + (rate.omega[0] - 1.0 / 0.01))) < 1e-9);
  for (int i = 0; i < N; ++i) {
    CHECK(rate.x[i] == state.vx[i] && rate.phi[i] == state.vphi[i]);
  }
  state.x[0] = (double)INFINITY;
  CHECK(bd_model_rate(model, &state, torque, &rate, &err) == BD_ERR_STATE);
  bd_model_free(model);
}

static void dahl_in_closed_form(void) {
  CHECK(fabs(bd_dahl_slide(1e-4, 0.0, 0.8, 1e4) - 0.5707962) < 5e-8);
  const double x[] = {0.0, 1e-4, 2e-4, 5e-5};
  double mu[4];
  bd_dahl_path(4, x, 0.0, 0.8, 1e4, mu);
  CHECK(fabs(mu[3] + 0.5647026) < 5e-8);
  bd_dahl_path(0, NULL, 0.0, 0.8, 1e4, NULL);
}

static const test tests[] = {
#define T(name)                                                                                    \
  { #name, name }
    T(errors_have_names),
    T(bad_scenes_are_refused),
    T(bad_friction_is_refused),
    T(each_pulley_has_its_friction),
    T(laws_are_evaluated),
    T(belt_lines_have_their_lengths),
    T(settles_and_runs),
    T(bad_runs_are_refused),
    T(torque_functions_are_heard),
    T(rates_leave_no_trace),
    T(prescribed_motions),
    T(loads),
    T(dahl_in_closed_form),
    T(pulleys_have_names),
    T(messages_are_cut_between_characters),
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, (int)(sizeof tests / sizeof tests[0]));
}
