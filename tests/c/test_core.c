/* SPDX-License-Identifier: MIT
 *
 * The public C interface as a C program uses and misuses it, in ways that Python cannot; plain and
 * under sanitizers.
 */
#include <stdlib.h>

#include "base/base.h"
#include "check.h"
#include "scene.h"

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

/* Numbers that the binding would not hand on, laws that there are not, and no pulley. */
static void bad_scenes_are_refused(void) {
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
  const int unknown[] = {BD_N_LAWS, -1, 1000};
  for (int k = 0; k < 3; ++k) {
    bd_pulley pulleys[NP];
    bd_friction friction = test_friction, own = test_friction;
    memcpy(pulleys, test_pulleys, sizeof pulleys);
    pulleys[2].friction = &own;
    bd_scene scene = test_scene();
    scene.pulleys = pulleys;
    scene.friction = &friction;
    struct {
      double *place;
      const char *field;
    } const rows[] = {{&scene.belt.length, "belt.length"},
                      {&scene.belt.bending_damping, "belt.bending_damping"},
                      {&scene.contact.linear, "contact.linear"},
                      {&scene.gravity[1], "gravity.y"},
                      {&pulleys[1].radius, "pulleys[1].radius"},
                      {&pulleys[2].center[0], "pulleys[2].center.x"},
                      {&friction.dahl.sigma, "friction.sigma"},
                      {&own.dahl.mu_k, "pulleys[2].friction.mu_k"}};
    for (size_t row = 0; row < sizeof rows / sizeof rows[0]; ++row) {
      const double kept = *rows[row].place;
      *rows[row].place = bad[k];
      refused(&scene, rows[row].field, __LINE__);
      *rows[row].place = kept;
    }
    own.law = unknown[k];
    refused(&scene, "pulleys[2].friction", __LINE__);
    friction.law = unknown[k];
    refused(&scene, "friction", __LINE__);
  }
  bd_scene scene = test_scene();
  scene.n_pulleys = 0;
  refused(&scene, "pulleys", __LINE__);
  scene = test_scene();
  scene.belt.mesh = -1;
  refused(&scene, "belt.mesh", __LINE__);
  bd_pulley pulleys[NP];
  const bd_mount mount = {.kind = BD_MOUNT_PATH + 1};
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  pulleys[1].mount = &mount;
  scene = test_scene();
  scene.pulleys = pulleys;
  scene.belt.mesh = BD_MESH_JOINT;
  refused(&scene, "pulleys[1].mount.kind", __LINE__);
  CHECK(strcmp(bd_error_symbol(BD_OK), "BD_OK") == 0);
  CHECK(strcmp(bd_error_symbol(12345), "unknown") == 0);
}

/* Every number keeps its rule, and what follows from them cannot be computed with. */
static void scenes_out_of_all_scale_are_refused(void) {
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  scene.pulleys = pulleys;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  struct {
    double *place, value;
    const char *field;
  } const rows[] = {{&scene.belt.length, 1.7e308, "belt.length"},
                    {&scene.belt.length, 1e-130, "belt.length"},
                    {&scene.belt.linear_density, 1e-307, "belt.linear_density"},
                    {&scene.belt.axial_stiffness, 1.7e308, "belt.axial_stiffness"},
                    {&pulleys[0].center[1], 1.7e308, "pulleys"},
                    {&pulleys[2].radius, 1e160, "pulleys"}};
  for (size_t row = 0; row < sizeof rows / sizeof rows[0]; ++row) {
    const double kept = *rows[row].place;
    *rows[row].place = rows[row].value;
    refused(&scene, rows[row].field, __LINE__);
    *rows[row].place = kept;
  }
}

/* Names are copied; an index without a pulley has a label as well. */
static void pulleys_have_names(void) {
  char own[] = "idler";
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  scene.pulleys = pulleys;
  pulleys[1].name = own;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  own[0] = 'X';
  CHECK(strcmp(bd_pulley_label(model, 1).text, "pulley \"idler\"") == 0);
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

static int swing(double t, double *value, void *user) {
  const double *limits = user; /* of the times that it may be called for */
  CHECK(t >= limits[0] && t <= limits[1]);
  *value = t > limits[2] ? (double)NAN : 0.01 * (1.0 - cos(200.0 * t));
  return t > limits[3] ? 7 : 0;
}

/* Without torque functions, of which a record has nothing to keep and settling nothing to look for;
 * the sanitizers see what is not there read. */
static void free_pulleys_and_records_need_no_torque(void) {
  static room r, r2;
  bd_error err;
  bd_state state = state_in(&r), end = state_in(&r2);
  bd_model *model = settled_drive(&state);
  bd_settling *settling = NULL;
  bd_settle_options options;
  bd_settle_options_default(&options);
  options.free_pulleys = 1;
  CHECK(bd_settle_create(&settling, model, NULL, &options, &err) == BD_OK);
  CHECK(come_to_rest(settling, &err) == BD_OK);
  bd_settle_free(settling);
  bd_sim *sim[2] = {NULL, NULL};
  for (int k = 0; k < 2; ++k) {
    CHECK(bd_sim_create(&sim[k], model, &state, NULL, 1e-3, NULL, &err) == BD_OK);
  }
  CHECK(bd_sim_advance(sim[0], 3, &err) == BD_MORE);
  const size_t size = bd_sim_export(sim[0], NULL);
  char *record = calloc(size, 1);
  CHECK(record && bd_sim_export(sim[0], record) == size);
  CHECK(bd_sim_import(sim[1], record, size - 1, &err) == BD_ERR_OPTION);
  CHECK(bd_sim_import(sim[1], record, size, &err) == BD_OK);
  CHECK(finish(sim[0], &err) == BD_OK && bd_sim_state(sim[0], &state) == BD_OK);
  CHECK(finish(sim[1], &err) == BD_OK && bd_sim_state(sim[1], &end) == BD_OK);
  CHECK(memcmp(state.x, end.x, N * sizeof *end.x) == 0);
  bd_sim_free(sim[0]);
  bd_sim_free(sim[1]);
  bd_model_free(model);
  free(record);
}

/* Works overflow before the state does, which where every step is checked must not be taken for an
 * error of the program. */
static void numbers_out_of_scale_break_no_invariant(void) {
  static room r;
  bd_error err;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  bd_options options;
  bd_sim *sim = NULL;
  bd_options_default(&options);
  options.method = "rodas4";
  state.vx[3] -= 1.9e102;
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1e-3, &options, &err) == BD_OK);
  CHECK(finish(sim, &err) == BD_ERR_NOT_FINITE);
  bd_sim_free(sim);
  bd_model_free(model);
}

/* A run by small chunks: what may be called when, and what it fills. */
static void settles_and_runs(void) {
  static room r, r2;
  bd_error err;
  bd_state state = state_in(&r), end = state_in(&r2);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  const double t[] = {0.0, 1e-3, 1e-3, 2e-3}, more[] = {0.5e-3};
  const double values[4][NP] = {{0}, {-5, 1, 0}, {-10, 1, 0}, {0}};
  const bd_torque_term term = {.kind = BD_TORQUE_PIECEWISE, .n_t = 4, .t = t, .values = values[0]};
  const bd_torque torque = {.n_terms = 1, .terms = &term, .n_breakpoints = 1, .breakpoints = more};
  enum { SAMPLES = 7 };
  double times[SAMPLES] = {0, 0.3e-3, 0.5e-3, 1e-3, 1e-3, 2.5e-3, 4e-3};
#define X(name, group, size, unit, text) +1
  static double rows[0 BD_OUTPUTS(X)][SAMPLES * N], energy[SAMPLES * BD_N_ENERGY];
#undef X
  static int32_t touched[SAMPLES * N];
  bd_output out = {.pulley = touched};
  int k = 0;
#define X(name, group, size, unit, text) out.name = rows[k++];
  BD_OUTPUTS(X)
#undef X
  out.energy = energy;
  bd_sim *sim = NULL;
  CHECK(bd_sim_create(&sim, model, &state, &torque, 3e-3, NULL, &err) == BD_OK);
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_ERR_OPTION);
  times[6] = 3e-3;
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_OK);
  CHECK(bd_sim_set_output(sim, SAMPLES, times, &out, &err) == BD_ERR_BUSY);
  CHECK(bd_sim_advance(sim, 1, &err) == BD_MORE && bd_sim_samples(sim) == 1);
  CHECK(finish(sim, &err) == BD_OK);
  CHECK(bd_sim_advance(sim, 1, &err) == BD_OK); /* at the end: stays there */
  CHECK(bd_sim_samples(sim) == SAMPLES && bd_sim_time(sim) == 3e-3);
  CHECK(bd_sim_pass(sim, 0) && !bd_sim_pass(sim, 99) && !bd_sim_pass(sim, -1));
  bd_sim_state(sim, &end);
  CHECK(end.omega[0] != 0.0 && memcmp(end.x, out.x + 6 * N, N * sizeof(double)) == 0);
  for (int i = 0; i < SAMPLES * N; ++i) {
    CHECK(touched[i] >= -1 && touched[i] < NP && out.normal[i] >= 0.0);
  }
  bd_sim_free(sim);
  bd_model_free(model);
}

/* Data that the binding would not hand on; what failed leaves no simulation. */
static void bad_runs_are_refused(void) {
  static room r;
  bd_error err;
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  CHECK(bd_sim_create(&sim, model, &state, NULL, (double)NAN, NULL, &err) == BD_ERR_OPTION && !sim);
  const double zero[2 * NP] = {0}, one[] = {1.0}, nan3[NP] = {0, (double)NAN, 0};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = zero, .values = nan3},
      {.kind = BD_TORQUE_VISCOUS, .coefficients = nan3},
      {.kind = BD_TORQUE_FUNCTION},
      {.kind = BD_TORQUE_CALL},
      {.kind = BD_TORQUE_LOAD, .against = {.quadratic = (double)NAN}},
      {.kind = BD_TORQUE_LOAD, .n_t = 2, .t = zero, .values = nan3},
      {.kind = BD_TORQUE_TABLE},
      {.kind = BD_TORQUE_TABLE, .n_points = 1, .omega = zero, .torque = nan3 + 1},
      {.kind = BD_TORQUE_HARMONICS},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {1, one, nan3 + 1, zero}},
      {.kind = BD_TORQUE_HARMONICS, .of = NP, .harmonics = {1, one, zero, zero}},
      {.kind = 77},
  };
  for (size_t k = 0; k < sizeof terms / sizeof terms[0]; ++k) {
    const bd_torque torque = {.n_terms = 1, .terms = &terms[k]};
    CHECK(bd_sim_create(&sim, model, &state, &torque, 1.0, NULL, &err) == BD_ERR_TORQUE_DATA);
    CHECK(sim == NULL);
  }
  const bd_motion motions[] = {
      {.kind = BD_MOTION_PIECEWISE},
      {.kind = BD_MOTION_PIECEWISE, .n_t = 1, .t = zero, .values = nan3 + 1},
      {.pulley = NP, .kind = BD_MOTION_SPEED, .call = swing},
      {.pulley = -1, .kind = BD_MOTION_SPEED, .call = swing},
      {.kind = BD_MOTION_ANGLE},
      {.kind = 77, .call = swing},
      {.kind = BD_MOTION_ANGLE, .call = swing, .harmonics = {1, one, one, one}},
      {.n_t = 1, .t = zero, .values = zero, .fade = {0.0, INFINITY}},
  };
  for (size_t k = 0; k < sizeof motions / sizeof motions[0]; ++k) {
    const bd_torque torque = {.n_motions = 1, .motions = &motions[k]};
    CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-3, NULL, &err) == BD_ERR_TORQUE_DATA);
    CHECK(sim == NULL && strcmp(err.field, "motion") == 0);
  }
  state.vphi[7] = (double)NAN;
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1.0, NULL, &err) == BD_ERR_STATE);
  CHECK(err.body == 7 && strcmp(err.field, "vphi") == 0);
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

/* A motion's function is called within the run alone, and ends it by a code or by no number. */
static void motion_functions_are_heard(void) {
  static room r;
  const struct {
    double no_number, failure;
    int code;
  } rows[] = {{INFINITY, INFINITY, BD_OK},
              {INFINITY, 1e-3, BD_ERR_CALLBACK},
              {1e-3, INFINITY, BD_ERR_TORQUE_VALUE}};
  bd_error err = {0};
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(model != NULL);
  for (int k = 0; k < 3; ++k) {
    double limits[] = {0.0, 2e-3, rows[k].no_number, rows[k].failure};
    const bd_motion motion = {.kind = BD_MOTION_ANGLE, .call = swing, .user = limits};
    const bd_torque torque = {.n_motions = 1, .motions = &motion};
    CHECK(bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, &err) == BD_OK);
    CHECK(finish(sim, &err) == rows[k].code);
    CHECK(rows[k].code == BD_OK || err.pulley == 0);
    bd_sim_free(sim);
  }
  bd_model_free(model);
}

static const test tests[] = {
    {"bad_scenes_are_refused", bad_scenes_are_refused},
    {"scenes_out_of_all_scale_are_refused", scenes_out_of_all_scale_are_refused},
    {"pulleys_have_names", pulleys_have_names},
    {"messages_are_cut_between_characters", messages_are_cut_between_characters},
    {"free_pulleys_and_records_need_no_torque", free_pulleys_and_records_need_no_torque},
    {"numbers_out_of_scale_break_no_invariant", numbers_out_of_scale_break_no_invariant},
    {"settles_and_runs", settles_and_runs},
    {"bad_runs_are_refused", bad_runs_are_refused},
    {"torque_functions_are_heard", torque_functions_are_heard},
    {"motion_functions_are_heard", motion_functions_are_heard},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, (int)(sizeof tests / sizeof tests[0]));
}
