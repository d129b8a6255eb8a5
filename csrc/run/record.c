/* SPDX-License-Identifier: MIT
 *
 * The restart record: everything that a run needs to go on bit for bit, where a state alone has
 * positions, velocities and friction but not the step and its controller, the states a multistep
 * method looks back on, the rate and directions last evaluated, which links are listed near the
 * pulleys, what "auto" has chosen, and what guards, torque functions and twins remember.
 *
 * All of it lies together, in spans of the structs and in what was carved with BD_KEEP; a record is
 * a copy of these behind a head. Pointers are never part of it: a method is its row in the table,
 * and states, whose pointers go round with the steps, are visited one by one. The head names format
 * and build and holds check sums of the scene and of what follows; a record of another scene or
 * build, and one that was damaged, is refused, and whatever is used as an index is checked before
 * anything is read. Guarded by tests/test_record.py.
 */
#include <string.h>

#include "run/run.h"

enum { FORMAT = 3 };

typedef struct head {
  char magic[8];
  uint32_t format, build;  /* build: of compiler and instruction level */
  uint64_t size;           /* of what follows */
  uint64_t scene, content; /* check sums */
} head;

static const char MAGIC[8] = {'b', 'e', 'l', 't', 'd', 'y', 'n', 'R'};

/* FNV-1a (Fowler, Noll, Vo), 64 bits. */
static uint64_t hash(uint64_t sum, const void *data, size_t size) {
  const unsigned char *byte = data;
  for (size_t k = 0; k < size; ++k) {
    sum = (sum ^ byte[k]) * 0x100000001b3u;
  }
  return sum;
}

static const uint64_t EMPTY = 0xcbf29ce484222325u;

/* --- visiting -------------------------------------------------------------------------------- */

/* What a simulation remembers besides arrays, from one member to another of its structs. */
#define SPAN(first, last)                                                                          \
  {                                                                                                \
    offsetof(bd_sim, first),                                                                       \
        offsetof(bd_sim, last) + sizeof(((bd_sim *)NULL)->last) - offsetof(bd_sim, first)          \
  }
static const struct {
  size_t begin, size;
} spans[] = {
    SPAN(t0, stats),
    SPAN(stepper.history_h, stepper.report),
    SPAN(stepper.plan.t_piece, stepper.plan.skip_power),
    SPAN(stepper.plan.search.margin, stepper.plan.search.rebuilds),
    SPAN(stepper.plan.torques.motion.begin, stepper.plan.torques.motion.begin),
    SPAN(stepper.functions.left_out, stepper.functions.ranges),
    SPAN(choice.per_second, choice.look_after),
    SPAN(guard.fed, guard.bounces),
    SPAN(twin.least, twin.seen_t),
    SPAN(twin.missed.steps, twin.missed.next_look),
};

typedef struct visitor {
  enum { MEASURE, WRITE, CHECK, READ } does;
  char *out;
  const char *in;
  size_t used;
  int bad; /* CHECK: an index is out of its range */
} visitor;

static void visit(visitor *v, void *data, size_t size) {
  if (v->does == WRITE) {
    memcpy(v->out + v->used, data, size);
  } else if (v->does == READ) {
    memcpy(data, v->in + v->used, size);
  }
  v->used += size;
}

/* A number that is used as an index or as a count; returns what is read. */
static int visit_index(visitor *v, int *value, int least, int most) {
  int given = *value;
  if (v->does == CHECK) {
    memcpy(&given, v->in + v->used, sizeof given);
    v->bad |= given < least || given > most;
  }
  visit(v, value, sizeof *value);
  return given;
}

/* A method that the stepper was made for, or the one that steps are left to. Twins have the methods
 * of the run they follow, or one of their own. */
static void visit_method(visitor *v, const bd_method **method, const bd_stepper *stepper,
                         const bd_auto *choice) {
  const bd_method *const made[] = {choice->method[0], choice->method[1], stepper->method,
                                   bd_method_find("lie")};
  enum { N = sizeof made / sizeof made[0] };
  int index = 0;
  while (index < N - 1 && made[index] != *method) {
    ++index;
  }
  const int given = visit_index(v, &index, 0, N - 1);
  v->bad |= v->does == CHECK && !v->bad && !made[given];
  if (v->does == READ) {
    *method = made[index];
  }
}

/* Between two steps: y_new, y_mid, the Jacobian and all stages but the first are made anew. */
static void visit_sim(visitor *v, bd_sim *sim, const bd_auto *choice) {
  bd_stepper *stepper = &sim->stepper;
  bd_search *search = &stepper->plan.search;
  const bd_layout *lay = &stepper->model->lay;
  const size_t state = lay->size * sizeof *stepper->y;
  int room = 0;
  while (room < MAX_HISTORY && stepper->history[room]) {
    ++room;
  }
  visit_method(v, &stepper->method, stepper, choice);
  visit_method(v, &stepper->now, stepper, choice);
  visit_index(v, &stepper->n_history, 0, room);
  visit_index(v, &sim->choice.now, 0, N_AUTO - 1);
  for (int j = 0; j < lay->np; ++j) {
    visit_index(v, &search->n_runs[j], 0, search->max_runs);
  }
  for (int k = 0; k < lay->np * search->max_runs; ++k) {
    visit_index(v, &search->runs[k].begin, 0, lay->n8);
    visit_index(v, &search->runs[k].end, 0, lay->n8);
  }
  for (size_t k = 0; k < sizeof spans / sizeof spans[0]; ++k) {
    visit(v, (char *)sim + spans[k].begin, spans[k].size);
  }
  visit(v, stepper->y, state);
  visit(v, stepper->stage[0], state);
  for (int k = 0; k < room; ++k) {
    visit(v, stepper->history[k], state);
  }
  visit(v, sim->kept, sim->n_kept);
  bd_sim *const beside[] = {sim->twin.sim, sim->twin.still, sim->twin.missed.pair[0],
                            sim->twin.missed.pair[1]};
  for (size_t k = 0; k < sizeof beside / sizeof beside[0]; ++k) {
    if (beside[k]) {
      visit_sim(v, beside[k], choice);
    }
  }
  if (v->does == READ) {
    bd_stepper_weigh_friction(stepper);
  }
}

/* --- the scene ------------------------------------------------------------------------------- */

static uint64_t hash_numbers(uint64_t sum, const double *numbers, size_t n) {
  return hash(sum, numbers, n * sizeof *numbers);
}

static uint64_t hash_harmonics(uint64_t sum, const bd_harmonics *of) {
  sum = hash_numbers(sum, of->orders, of->n);
  sum = hash_numbers(sum, of->amplitudes, of->n);
  return hash_numbers(sum, of->phases, of->n);
}

/* All parameters of a group. */
static uint64_t hash_group(uint64_t sum, const char *group, const void *values) {
  double numbers[BD_MAX_ELEMENTS];
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    if (strcmp(bd_parameters[k].group, group) == 0) {
      const int n = bd_parameter_values(&bd_parameters[k], values, numbers);
      sum = hash_numbers(sum, numbers, (size_t)n);
    }
  }
  return sum;
}

/* Of everything that was given when the simulation was made, but the state, the sample times and
 * max_steps, which may be another: of a torque or motion function, that there is one. */
static uint64_t scene_of(const bd_sim *sim) {
  const bd_model *model = sim->stepper.model;
  const bd_torque_set *set = &sim->stepper.plan.torques;
  const bd_options *options = &sim->options;
  const size_t np = (size_t)model->lay.np;
  uint64_t sum = EMPTY;
#define ADD(field) sum = hash(sum, &(field), sizeof(field))
  sum = hash_group(sum, "belt", &model->belt);
  ADD(model->belt.mesh);
  sum = hash_group(sum, "contact", &model->contact);
  ADD(model->gravity);
  ADD(model->origin);
  const double *const arrays[] = {model->cx, model->cy, model->radius, model->inertia};
  for (int k = 0; k < 4; ++k) {
    sum = hash_numbers(sum, arrays[k], np);
  }
  sum = hash(sum, model->side, np * sizeof *model->side);
  for (size_t j = 0; j < np; ++j) {
    const bd_friction *friction = &model->friction[j];
    ADD(friction->law);
    sum = hash_group(sum, bd_law_name(friction->law), &friction->dahl);
  }
  if (model->drag) {
    sum = hash(sum, model->drag, np * sizeof *model->drag);
  }
  for (int m = 0; m < model->lay.nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    sum = hash(sum, mount, offsetof(bd_mounted, has_stops)); /* all numbers that were given */
    sum = hash_numbers(sum, mount->t, mount->n_t);
    sum = hash_numbers(sum, mount->points, 2 * mount->n_t);
  }
  if (model->couplings) { /* numbers alone, without a gap */
    sum = hash(sum, model->couplings, (size_t)model->lay.nc * sizeof *model->couplings);
  }
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    const int load = bd_is_load(term);
    ADD(term->kind);
    sum = hash_numbers(sum, term->t, term->n_t);
    sum = hash_numbers(sum, term->values, term->n_t * (load ? 1 : np));
    sum = hash_numbers(sum, term->coefficients, term->kind == BD_TORQUE_VISCOUS ? np : 0);
    sum = hash_numbers(sum, term->omega, term->n_points);
    sum = hash_numbers(sum, term->torque, term->n_points);
    sum = hash_harmonics(sum, &term->harmonics);
    if (load) {
      ADD(term->pulley);
      ADD(term->of);
      ADD(term->against);
    }
  }
  for (size_t k = 0; k < set->motion.n; ++k) {
    const bd_motion *motion = &set->motion.motions[k];
    ADD(motion->pulley);
    ADD(motion->kind);
    sum = hash_numbers(sum, motion->t, motion->n_t);
    sum = hash_numbers(sum, motion->values, motion->n_t);
    sum = hash_harmonics(sum, &motion->harmonics);
    ADD(motion->fade);
  }
  sum = hash_numbers(sum, set->breaks, set->n_breaks);
  const char *method = sim->choice.method[0] ? "auto" : sim->stepper.method->name;
  sum = hash(sum, method, strlen(method));
  ADD(options->rtol);
  ADD(options->step);
  ADD(options->max_step);
  ADD(options->torque_interval);
  ADD(options->ledger);
  ADD(options->guards);
  ADD(sim->t_end);
#undef ADD
  return sum;
}

/* Bits are the same with the same compiler and instruction level alone. */
static uint32_t build_of(const bd_sim *sim) {
  const char *level = sim->stepper.plan.kernels->level;
  uint64_t sum = hash(EMPTY, level, strlen(level));
#ifdef __VERSION__
  sum = hash(sum, __VERSION__, sizeof __VERSION__);
#endif
  return (uint32_t)(sum ^ sum >> 32);
}

/* --- out and in ------------------------------------------------------------------------------ */

size_t bd_sim_export(const bd_sim *sim, void *record) {
  /* nothing is written to the simulation when measuring or writing */
  bd_sim *const visited = (bd_sim *)(uintptr_t)sim;
  visitor v = {.does = MEASURE};
  if (sim->status < 0 && sim->status != BD_ERR_MAX_STEPS) {
    return 0;
  }
  visit_sim(&v, visited, &visited->choice);
  head first = {.format = FORMAT, .size = v.used};
  if (!record) {
    return sizeof first + v.used;
  }
  v = (visitor){.does = WRITE, .out = (char *)record + sizeof first};
  visit_sim(&v, visited, &visited->choice);
  memcpy(first.magic, MAGIC, sizeof first.magic);
  first.build = build_of(sim);
  first.scene = scene_of(sim);
  first.content = hash(EMPTY, v.out, v.used);
  memcpy(record, &first, sizeof first);
  return sizeof first + v.used;
}

int bd_sim_import(bd_sim *sim, const void *record, size_t size, bd_error *err) {
  if (sim->settling || sim->started) {
    return bd_fail(err, BD_ERR_BUSY, "record",
                   "a record is taken by a simulation that has not begun, and not by settling");
  }
  head first;
  visitor v = {.does = MEASURE};
  visit_sim(&v, sim, &sim->choice);
  memset(&first, 0, sizeof first);
  memcpy(&first, record, size < sizeof first ? size : sizeof first);
  if (memcmp(first.magic, MAGIC, sizeof first.magic) != 0 || first.format != FORMAT) {
    return bd_fail(err, BD_ERR_OPTION, "record",
                   "not a restart record of this version of the core (format %d)", (int)FORMAT);
  }
  if (first.build != build_of(sim)) {
    return bd_fail(
        err, BD_ERR_OPTION, "record",
        "the record was made with another instruction level than \"%s\" (BELTDYN_KERNELS "
        "chooses it) or another compiler, which do not give the same bits",
        sim->stepper.plan.kernels->level);
  }
  if (first.scene != scene_of(sim) || first.size != v.used) {
    return bd_fail(err, BD_ERR_OPTION, "record",
                   "the record is of another run: drive, torques, t_end and options must be those "
                   "it was made with");
  }
  const char *content = (const char *)record + sizeof first;
  if (size != sizeof first + v.used || first.content != hash(EMPTY, content, v.used)) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: its check sum is wrong");
  }
  v = (visitor){.does = CHECK, .in = content};
  visit_sim(&v, sim, &sim->choice);
  if (v.bad) {
    return bd_fail(err, BD_ERR_OPTION, "record", "the record is damaged: an index is out of range");
  }
  v = (visitor){.does = READ, .in = content};
  visit_sim(&v, sim, &sim->choice);
  /* made anew: what follows from the time reached */
  sim->next_break = sim->next_sample = 0;
  while (sim->started && sim->next_sample < sim->n_samples &&
         sim->t_sample[sim->next_sample] <= sim->stepper.t) {
    ++sim->next_sample;
  }
  sim->status = sim->started ? BD_MORE : BD_OK;
  sim->stepper.jacobian_known = 0;
  bd_plan_place(&sim->stepper.plan, sim->stepper.t, sim->stepper.y);
  return BD_OK;
}
