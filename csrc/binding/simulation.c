/* SPDX-License-Identifier: MIT
 *
 * Simulation: one run, advanced in chunks of some milliseconds without the GIL.
 *
 * Rules that hold here: every use of the C simulation is between bd_core_enter and bd_core_leave,
 * which set and clear an atomic flag, so a second thread or a torque function that calls back gets
 * a RuntimeError; the arrays the core writes to are held by the Simulation, their users only get
 * views, so they cannot be freed or resized under a run; signals are answered between chunks, where
 * the state is that of a finished step; stop() sets a flag and touches nothing else. Guarded by
 * tests/test_module_run.py and tests/test_threads.py.
 */
#include "binding/simulation.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <time.h>

/* --- one user at a time ---------------------------------------------------------------------- */

int bd_core_enter(bd_core_sim *self) {
  if (!self->sim) {
    PyErr_SetString(PyExc_RuntimeError, "the simulation was cleared by the garbage collector");
    return -1;
  }
  if (!atomic_exchange(&self->busy, true)) {
    return 0;
  }
  PyErr_SetString(PyExc_RuntimeError,
                  "the simulation is running in another call (of another thread, or its torque "
                  "function called back)");
  return -1;
}

void bd_core_leave(bd_core_sim *self) {
  atomic_store(&self->busy, false);
}

/* --- making one ------------------------------------------------------------------------------ */

static PyObject *passes_of(const bd_sim *sim) {
  PyObject *list = PyList_New(0);
  const char *name;
  for (int k = 0; list && (name = bd_sim_pass(sim, k)); k++) {
    list = bd_core_append(list, PyUnicode_FromString(name));
  }
  return bd_core_tuple(list);
}

/* One of a model, seen by nobody before it is whole. */
static bd_core_sim *begin(PyTypeObject *type, PyObject *model, const char *call) {
  const bd_core_module *module = PyType_GetModuleState(type);
  if (!module || !PyObject_TypeCheck(model, module->model_type)) {
    return module ? (void *)PyErr_Format(PyExc_TypeError, "%s() argument 1 must be %s, not %.50s",
                                         call, module->model_type->tp_name,
                                         model == Py_None ? "None" : Py_TYPE(model)->tp_name)
                  : NULL;
  }
  bd_core_sim *self = (bd_core_sim *)type->tp_alloc(type, 0);
  if (self) {
    PyObject_GC_UnTrack(self);
    self->model = (bd_core_model *)Py_NewRef(model);
    atomic_init(&self->busy, false);
  }
  return self;
}

/* It, if it has a simulation, or what the code stands for, if it is not 0. */
static PyObject *finish(bd_core_sim *self, int code, const bd_error *err) {
  self->passes = self->sim ? passes_of(self->sim) : code < 0 ? bd_core_raise(code, err) : NULL;
  PyObject_GC_Track(self);
  if (!self->passes) {
    Py_CLEAR(self);
  }
  return (PyObject *)self;
}

static PyObject *sim_new(PyTypeObject *type, PyObject *args, PyObject *keywords) {
  PyObject *model, *mapping, *terms, *breakpoints = NULL, *motions = NULL;
  double t_end;
  bd_options options;
  const bd_argument rows[] = {
      {"model", BD_OBJECT, &model},
      {"state", BD_OBJECT, &mapping},
      {"torque", BD_OBJECT, &terms},
      {"t_end", BD_FINITE, &t_end},
      {"method", BD_STR, &options.method},
      {"rtol", BD_REAL, &options.rtol},
      {"step", BD_REAL, &options.step},
      {"max_step", BD_REAL, &options.max_step},
      {"max_steps", BD_LONG, &options.max_steps},
      {"ledger", BD_BOOL, &options.ledger},
      {"breakpoints", BD_OBJECT, &breakpoints},
      {"torque_interval", BD_REAL, &options.torque_interval},
      {"guards", BD_BOOL, &options.guards},
      {"motion", BD_OBJECT, &motions},
      {0},
  };
  bd_options_default(&options);
  bd_core_sim *self = bd_convert_arguments(args, keywords, "Simulation", 4, 4, rows) < 0
                          ? NULL
                          : begin(type, model, "Simulation");
  if (!self) {
    return NULL;
  }
  bd_core_torque torque = {0};
  bd_state state;
  bd_error err = {0};
  int code = 0;
  PyObject *given = bd_core_state_read(&state, mapping, &self->model->info);
  if (given && bd_core_torque_read(&torque, terms, breakpoints, motions, self->model->model,
                                   &self->stop) == 0) {
    code = bd_sim_create(&self->sim, self->model->model, &state, &torque.torque, t_end, &options,
                         &err);
  }
  if (self->sim) {
    self->ledger = options.ledger;
    self->calls = torque.calls;
    self->n_calls = torque.n_calls;
    torque.calls = NULL;
  }
  Py_XDECREF(given);
  bd_core_torque_release(&torque);
  return finish(self, code, &err);
}

static PyObject *sim_settle(PyObject *type, PyObject *args, PyObject *keywords) {
  PyObject *model, *mapping = Py_None, *offset = Py_None;
  bd_settle_options options;
  const bd_argument rows[] = {
      {"model", BD_OBJECT, &model},
      {"state", BD_OBJECT, &mapping},
      {"friction", BD_BOOL, &options.friction},
      {"free_pulleys", BD_BOOL, &options.free_pulleys},
      {"offset", BD_OBJECT, &offset},
      {"move_time", BD_REAL, &options.move_time},
      {"shift", BD_REAL, &options.shift},
      {"tolerance", BD_REAL, &options.tolerance},
      {"max_time", BD_REAL, &options.max_time},
      {"speed", BD_REAL, &options.speed},
      {0},
  };
  bd_settle_options_default(&options);
  bd_core_sim *self = bd_convert_arguments(args, keywords, "settle", 1, 2, rows) < 0
                          ? NULL
                          : begin((PyTypeObject *)type, model, "settle");
  if (!self) {
    return NULL;
  }
  const npy_intp shape[2] = {self->model->info.n_pulleys, 2};
  bd_state state;
  bd_error err = {0};
  int code = 0;
  PyObject *given =
      mapping == Py_None ? NULL : bd_core_state_read(&state, mapping, &self->model->info);
  PyArrayObject *offsets =
      offset == Py_None || PyErr_Occurred() ? NULL : bd_convert_array(offset, "offset", 2, shape);
  options.offset = offsets ? PyArray_DATA(offsets) : NULL;
  if (!PyErr_Occurred()) {
    code = bd_settle_create(&self->settling, self->model->model, given ? &state : NULL, &options,
                            &err);
    self->sim = code < 0 ? NULL : bd_settle_sim(self->settling);
  }
  Py_XDECREF(offsets);
  Py_XDECREF(given);
  return finish(self, code, &err);
}

static int sim_traverse(PyObject *object, visitproc visit, void *arg) {
  bd_core_sim *self = (bd_core_sim *)object;
  Py_VISIT(Py_TYPE(object));
  Py_VISIT(self->model);
  Py_VISIT(self->outputs);
  for (Py_ssize_t i = 0; i < self->n_calls; i++) {
    Py_VISIT(self->calls[i].callable);
    Py_VISIT(self->calls[i].theta);
    Py_VISIT(self->calls[i].omega);
  }
  return 0;
}

/* The C simulation goes first: it points into everything else. */
static int sim_clear(PyObject *object) {
  bd_core_sim *self = (bd_core_sim *)object;
  bd_core_call *calls = self->calls;
  Py_ssize_t n_calls = self->n_calls;
  if (self->settling) {
    bd_settle_free(self->settling);
  } else {
    bd_sim_free(self->sim);
  }
  self->sim = NULL;
  self->settling = NULL;
  self->calls = NULL;
  self->n_calls = 0;
  bd_core_calls_free(calls, n_calls);
  Py_CLEAR(self->outputs);
  Py_CLEAR(self->model);
  return 0;
}

static void sim_dealloc(PyObject *object) {
  bd_core_sim *self = (bd_core_sim *)object;
  PyTypeObject *type = Py_TYPE(object);
  PyObject_GC_UnTrack(object);
  sim_clear(object);
  Py_CLEAR(self->passes);
  type->tp_free(object);
  Py_DECREF(type);
}

/* --- samples --------------------------------------------------------------------------------- */

static PyObject *attach_samples(bd_core_sim *self, PyArrayObject *t, PyObject *wanted) {
  if (self->outputs || self->started) {
    PyErr_SetString(PyExc_RuntimeError, self->outputs ? "the sample times are set already"
                                                      : "sample times must be set before the run");
    return NULL;
  }
  PyObject *dict = PyDict_New(), *keep = PyList_New(0);
  const npy_intp n = PyArray_DIM(t, 0);
  const int n_energy = self->ledger ? bd_model_energy_terms(self->model->model, NULL) : 0;
  bd_error err = {0};
  bd_output output = {0};
  int failed = !dict || !keep ||
               bd_core_output_new(&output, keep, dict, &self->model->info, n_energy, n, wanted) < 0;
  if (!failed) {
    const int code = bd_sim_set_output(self->sim, (size_t)n, PyArray_DATA(t), &output, &err);
    failed = code < 0 && !bd_core_raise(code, &err);
  }
  if (failed) {
    Py_CLEAR(dict);
  } else {
    self->outputs = Py_NewRef(keep);
  }
  Py_XDECREF(keep);
  return dict;
}

static PyObject *sim_sample(PyObject *object, PyObject *args, PyObject *keywords) {
  bd_core_sim *self = (bd_core_sim *)object;
  const npy_intp any = BD_ANY;
  PyObject *times, *outputs = Py_None, *dict = NULL;
  const bd_argument rows[] = {{"t", BD_OBJECT, &times}, {"outputs", BD_OBJECT, &outputs}, {0}};
  if (bd_convert_arguments(args, keywords, "sample", 1, 2, rows) < 0) {
    return NULL;
  }
  PyObject *wanted = outputs == Py_None ? NULL : bd_core_output_names(outputs);
  if (outputs != Py_None && !wanted) {
    return NULL;
  }
  PyArrayObject *t = bd_convert_array(times, "t_eval", 1, &any);
  if (t && bd_core_enter(self) == 0) {
    dict = attach_samples(self, t, wanted);
    bd_core_leave(self);
  }
  Py_XDECREF(wanted);
  Py_XDECREF(t);
  return dict;
}

/* --- running --------------------------------------------------------------------------------- */

/* A chunk is long against the cost of taking the GIL, short against a user's patience. */
static const double CHUNK_SECONDS = 8e-3, LEAST_SECONDS = 1e-3;
enum { FIRST_CHUNK = 8, MOST_STEPS = 1 << 20 };

static double clock_seconds(void) {
  struct timespec now;
#ifdef CLOCK_MONOTONIC
  clock_gettime(CLOCK_MONOTONIC, &now);
#else
  timespec_get(&now, TIME_UTC);
#endif
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Steps for a chunk, from the rate of the last one and the wall time left. */
static long chunk_steps(double rate, double left) {
  if (!(rate > 0)) {
    return FIRST_CHUNK;
  }
  double steps = rate * fmin(fmax(left, LEAST_SECONDS), CHUNK_SECONDS);
  return (long)fmin(fmax(steps, 1), MOST_STEPS);
}

/* The rate after a chunk: as measured, but no more than four times the last, for a clock that is
 * coarse and a chunk that is short. */
static double next_rate(double rate, long steps, double seconds) {
  double measured = (double)steps / fmax(seconds, 1e-6);
  double most = rate > 0 ? 4 * rate : 4 * FIRST_CHUNK / CHUNK_SECONDS;
  return fmin(measured, most);
}

/* Without the GIL unless there is Python to call, whose own code lets other threads in. The time
 * waited for the GIL is not the chunk's. */
static int advance_chunk(bd_core_sim *self, double left, bd_error *err) {
  const long steps = chunk_steps(self->rate, left);
  PyThreadState *thread = self->n_calls ? NULL : PyEval_SaveThread();
  const double begin = clock_seconds();
  int code = self->settling ? bd_settle_advance(self->settling, steps, err)
                            : bd_sim_advance(self->sim, steps, err);
  self->rate = next_rate(self->rate, steps, clock_seconds() - begin);
  if (thread) {
    PyEval_RestoreThread(thread);
  }
  return code;
}

static PyObject *sim_advance(PyObject *object, PyObject *args, PyObject *keywords) {
  bd_core_sim *self = (bd_core_sim *)object;
  PyObject *argument;
  double seconds;
  const bd_argument rows[] = {{"seconds", BD_OBJECT, &argument}, {0}};
  if (bd_convert_arguments(args, keywords, "advance", 1, 1, rows) < 0 ||
      bd_convert_real(argument, "seconds", &seconds) < 0) {
    return NULL;
  }
  if (!(seconds >= 0)) {
    return PyErr_Format(PyExc_ValueError, "seconds must be >= 0, got %R", argument);
  }
  if (bd_core_enter(self) < 0) {
    return NULL;
  }
  self->started = 1;
  bd_error err = {0};
  int code, interrupted = 0;
  double now = clock_seconds();
  const double end = now + seconds;
  do {
    if (bd_core_check_stop(&self->stop) < 0) {
      code = BD_MORE;
      interrupted = 1;
      break;
    }
    code = advance_chunk(self, end - now, &err);
    now = clock_seconds();
    if (code == BD_MORE && self->n_calls) {
      /* A callable written in C runs no bytecode: let other threads in here. */
      PyEval_RestoreThread(PyEval_SaveThread());
    }
    interrupted = code == BD_MORE && PyErr_CheckSignals() < 0;
  } while (code == BD_MORE && !interrupted && now < end);
  bd_core_leave(self);
  if (interrupted || (code < 0 && bd_error_kind(code) == BD_KIND_CALL && !PyErr_Occurred() &&
                      bd_core_check_stop(&self->stop) < 0)) {
    return NULL;
  }
  return bd_core_result(PyBool_FromLong(code == BD_OK), code, &err);
}

static PyObject *sim_stop(PyObject *object, PyObject *Py_UNUSED(none)) {
  ((bd_core_sim *)object)->stop = 1;
  Py_RETURN_NONE;
}

/* --- the type -------------------------------------------------------------------------------- */

static PyMethodDef sim_methods[] = {
    {"settle", (PyCFunction)(void (*)(void))sim_settle, METH_VARARGS | METH_KEYWORDS | METH_CLASS,
     "settle($type, /, model, state=None, *, friction=False, free_pulleys=False,\n"
     "       offset=None, move_time=0.0, shift=0.0, tolerance=..., max_time=0.0,\n"
     "       speed=0.0)\n--\n\n"
     "A simulation that brings the belt to rest under preload."},
    BD_CORE_KEYWORDS("sample", sim_sample,
                     "sample($self, /, t, outputs=None)\n--\n\n"
                     "Attach sample times; once, before the first advance()."),
    BD_CORE_KEYWORDS(
        "advance", sim_advance,
        "advance($self, /, seconds)\n--\n\n"
        "Run for about this much wall time [s]; True at the end of the run, else False."),
    {"stop", sim_stop, METH_NOARGS,
     "stop($self, /)\n--\n\n"
     "End the run soon: for other threads, and for callbacks that cannot raise."},
    {"state", bd_core_sim_state, METH_NOARGS,
     "state($self, /)\n--\n\n"
     "The state now, a dict of new arrays, and \"t\" [s]."},
    {"export_record", bd_core_sim_export, METH_NOARGS,
     "export_record($self, /)\n--\n\n"
     "Everything that the run needs to go on bit for bit, as bytes."},
    {"import_record", bd_core_sim_import, METH_O,
     "import_record($self, record, /)\n--\n\n"
     "Go on from a record of export_record(), of this or of another process."},
    {"time_passes", bd_core_sim_time_passes, METH_O,
     "time_passes($self, rounds, /)\n--\n\n"
     "Measure what the passes of a step cost at the state now reached, and end the run."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot sim_slots[] = {
    {Py_tp_doc,
     (void *)"Simulation(model, state, torque, t_end, *, method='auto', rtol=..., step=0.0,\n"
             "           max_step=0.0, max_steps=0, ledger=True, breakpoints=(),\n"
             "           torque_interval=..., guards=True, motion=())\n--\n\n"
             "One run; not to be used by two threads at once (RuntimeError)."},
    {Py_tp_new, sim_new},
    {Py_tp_traverse, sim_traverse},
    {Py_tp_clear, sim_clear},
    {Py_tp_dealloc, sim_dealloc},
    {Py_tp_methods, sim_methods},
    {Py_tp_getset, bd_core_sim_properties},
    {0, NULL},
};

static PyType_Spec sim_spec = {
    .name = "beltdyn._core.Simulation",
    .basicsize = sizeof(bd_core_sim),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = sim_slots,
};

int bd_core_add_simulation(PyObject *module, bd_core_module *state) {
  PyObject *type = PyType_FromModuleAndSpec(module, &sim_spec, NULL);
  state->simulation_type = (PyTypeObject *)type; /* the reference is the module's */
  return type ? PyModule_AddType(module, state->simulation_type) : -1;
}
