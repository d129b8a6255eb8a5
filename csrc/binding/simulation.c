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

static void free_core(bd_sim *sim, bd_settling *settling, volatile int *stop) {
  if (settling) {
    bd_settle_free(settling);
  } else {
    bd_sim_free(sim);
  }
  PyMem_Free((void *)stop);
}

/* The Python object around a ready simulation (and the settling that owns it, if any), which it
 * takes over with its flag, as it does the callables of the torque (if any); on failure all are
 * freed. The object comes last, so it is always whole. */
static PyObject *wrap(PyTypeObject *type, bd_sim *sim, bd_settling *settling, volatile int *stop,
                      bd_core_model *model, bd_core_torque *torque) {
  PyObject *passes = passes_of(sim);
  bd_core_sim *self = passes ? (bd_core_sim *)type->tp_alloc(type, 0) : NULL;
  if (!self) {
    Py_XDECREF(passes);
    free_core(sim, settling, stop);
    return NULL;
  }
  self->sim = sim;
  self->settling = settling;
  self->stop = stop;
  self->model = (bd_core_model *)Py_NewRef(model);
  self->passes = passes;
  atomic_init(&self->busy, false);
  if (torque) {
    self->calls = torque->calls;
    self->n_calls = torque->n_calls;
    torque->calls = NULL;
  }
  return (PyObject *)self;
}

/* The keyword options; those not given stay as they are. */
typedef struct {
  PyObject *method, *rtol, *step, *max_step, *max_steps, *ledger, *torque_interval, *guards;
} option_objects;

static int read_options(bd_options *out, const option_objects *in) {
  if (in->method) {
    Py_ssize_t length;
    if (!PyUnicode_Check(in->method)) {
      PyErr_Format(PyExc_TypeError, "method must be a str, got %.100s",
                   Py_TYPE(in->method)->tp_name);
      return -1;
    }
    out->method = PyUnicode_AsUTF8AndSize(in->method, &length);
    if (!out->method) {
      return -1;
    }
    if (strlen(out->method) != (size_t)length) {
      PyErr_SetString(PyExc_ValueError, "method must not contain a null character");
      return -1;
    }
  }
  return (in->rtol && bd_convert_real(in->rtol, "rtol", &out->rtol) < 0) ||
                 (in->step && bd_convert_real(in->step, "step", &out->step) < 0) ||
                 (in->max_step && bd_convert_real(in->max_step, "max_step", &out->max_step) < 0) ||
                 (in->max_steps &&
                  bd_convert_long(in->max_steps, "max_steps", &out->max_steps) < 0) ||
                 (in->torque_interval && bd_convert_real(in->torque_interval, "torque_interval",
                                                         &out->torque_interval) < 0) ||
                 (in->guards && bd_convert_bool(in->guards, "guards", &out->guards) < 0) ||
                 (in->ledger && bd_convert_bool(in->ledger, "ledger", &out->ledger) < 0)
             ? -1
             : 0;
}

/* A flag of its own, for the core keeps its address while the simulation lives. */
static volatile int *new_stop(void) {
  volatile int *stop = PyMem_Calloc(1, sizeof *stop);
  if (!stop) {
    PyErr_NoMemory();
  }
  return stop;
}

static PyObject *sim_new(PyTypeObject *type, PyObject *args, PyObject *keywords) {
  char *names[] = {"model",  "state",    "torque",    "t_end",  "method",      "rtol",
                   "step",   "max_step", "max_steps", "ledger", "breakpoints", "torque_interval",
                   "guards", "motion",   NULL};
  bd_core_module *module = PyType_GetModuleState(type);
  PyObject *model_object, *mapping, *terms, *end, *breakpoints = NULL, *motions = NULL;
  option_objects in = {0};
  if (!module || !PyArg_ParseTupleAndKeywords(args, keywords, "O!OOO|$OOOOOOOOOO:Simulation", names,
                                              module->model_type, &model_object, &mapping, &terms,
                                              &end, &in.method, &in.rtol, &in.step, &in.max_step,
                                              &in.max_steps, &in.ledger, &breakpoints,
                                              &in.torque_interval, &in.guards, &motions)) {
    return NULL;
  }
  bd_core_model *model = (bd_core_model *)model_object;
  bd_options options;
  bd_options_default(&options);
  double t_end;
  if (bd_convert_finite(end, "t_end", &t_end) < 0 || read_options(&options, &in) < 0) {
    return NULL;
  }

  PyObject *self = NULL;
  bd_core_torque torque = {0};
  bd_core_state state;
  if (bd_core_state_read(&state, mapping, &model->info) < 0) {
    return NULL;
  }
  volatile int *stop = new_stop();
  if (!stop || bd_core_torque_read(&torque, terms, breakpoints, motions, model->model, stop) < 0) {
    PyMem_Free((void *)stop);
    goto out;
  }
  bd_error err = {0};
  bd_sim *sim = NULL;
  int code = bd_sim_create(&sim, model->model, &state.state, &torque.torque, t_end, &options, &err);
  if (code < 0) {
    bd_core_raise(code, &err);
    PyMem_Free((void *)stop);
    goto out;
  }
  self = wrap(type, sim, NULL, stop, model, &torque);
  if (self) {
    ((bd_core_sim *)self)->ledger = options.ledger;
  }
out:
  bd_core_state_release(&state);
  bd_core_torque_release(&torque);
  return self;
}

PyDoc_STRVAR(settle_doc,
             "settle($type, /, model, state=None, *, friction=False, free_pulleys=False,\n"
             "       offset=None, move_time=0.0, shift=0.0, tolerance=..., max_time=0.0,\n"
             "       speed=0.0)\n--\n\n"
             "A simulation that brings the belt to rest under preload.\n\n"
             "state: where to begin, a mapping as of state(); None: on the belt line. friction:\n"
             "friction acts meanwhile. free_pulleys: pulleys may turn. offset: (n_p, 2) [m], the\n"
             "centres start displaced by this and move in during move_time [s] (0: chosen).\n"
             "shift: link 0 is laid this far past its place along the belt line [m].\n"
             "tolerance: at rest when the unbalanced force is below this times the mean tension.\n"
             "max_time: give up after this much simulated time [s] (0: chosen). speed: of a belt\n"
             "that runs along itself, in its spans [m/s].\n"
             "Raises TypeError or ValueError naming the argument.");

static PyObject *sim_settle(PyObject *type, PyObject *args, PyObject *keywords) {
  char *names[] = {"model", "state",     "friction", "free_pulleys", "offset", "move_time",
                   "shift", "tolerance", "max_time", "speed",        NULL};
  bd_core_module *module = PyType_GetModuleState((PyTypeObject *)type);
  PyObject *model_object, *mapping = Py_None, *friction = NULL, *free_pulleys = NULL,
                          *offset = Py_None, *move_time = NULL, *shift = NULL, *tolerance = NULL,
                          *max_time = NULL, *speed = NULL;
  if (!module || !PyArg_ParseTupleAndKeywords(args, keywords, "O!|O$OOOOOOOO:settle", names,
                                              module->model_type, &model_object, &mapping,
                                              &friction, &free_pulleys, &offset, &move_time, &shift,
                                              &tolerance, &max_time, &speed)) {
    return NULL;
  }
  bd_core_model *model = (bd_core_model *)model_object;
  bd_settle_options options;
  bd_settle_options_default(&options);
  if ((friction && bd_convert_bool(friction, "friction", &options.friction) < 0) ||
      (free_pulleys && bd_convert_bool(free_pulleys, "free_pulleys", &options.free_pulleys) < 0) ||
      (move_time && bd_convert_real(move_time, "move_time", &options.move_time) < 0) ||
      (shift && bd_convert_real(shift, "shift", &options.shift) < 0) ||
      (tolerance && bd_convert_real(tolerance, "tolerance", &options.tolerance) < 0) ||
      (max_time && bd_convert_real(max_time, "max_time", &options.max_time) < 0) ||
      (speed && bd_convert_real(speed, "speed", &options.speed) < 0)) {
    return NULL;
  }

  PyObject *self = NULL;
  bd_core_state state = {0};
  PyArrayObject *offsets = NULL;
  if (mapping != Py_None && bd_core_state_read(&state, mapping, &model->info) < 0) {
    return NULL;
  }
  if (offset != Py_None) {
    const npy_intp shape[2] = {model->info.n_pulleys, 2};
    offsets = bd_convert_array(offset, "offset", 2, shape);
    if (!offsets) {
      goto out;
    }
    options.offset = PyArray_DATA(offsets);
  }
  bd_error err = {0};
  bd_settling *settling = NULL;
  int code = bd_settle_create(&settling, model->model, mapping == Py_None ? NULL : &state.state,
                              &options, &err);
  volatile int *stop = code < 0 ? NULL : new_stop();
  if (code < 0) {
    bd_core_raise(code, &err);
  } else if (!stop) {
    bd_settle_free(settling);
  } else {
    self = wrap((PyTypeObject *)type, bd_settle_sim(settling), settling, stop, model, NULL);
  }
out:
  Py_XDECREF(offsets);
  bd_core_state_release(&state);
  return self;
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
  free_core(self->sim, self->settling, self->stop);
  self->sim = NULL;
  self->settling = NULL;
  self->stop = NULL;
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

PyDoc_STRVAR(
    sample_doc,
    "sample($self, /, t, outputs=None)\n--\n\n"
    "Attach sample times; once, before the first advance().\n\n"
    "t: times [s], shape (n_t,), non-decreasing and within the run. outputs: names of\n"
    "those to compute and keep; None: all but \"span_tension\" and \"across\". Returns a\n"
    "dict of arrays (n_t, width): OUTPUTS by name (float64; \"energy\" only with the\n"
    "ledger; \"load\" of shape (n_t, n_p, 2)), \"pulley\" (int32: the pulley the link\n"
    "touches, or -1), \"span_tension\" (as span_tension()), \"across\" (as bd_output). The\n"
    "run fills them row by row; rows not yet written hold NaN and -1. They stay valid\n"
    "after the simulation.\n"
    "Raises TypeError or ValueError for bad times, RuntimeError if called too late,\n"
    "KeyboardInterrupt while it fills them: it may then be called again.");

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
  char *names[] = {"t", "outputs", NULL};
  bd_core_sim *self = (bd_core_sim *)object;
  const npy_intp any = BD_ANY;
  PyObject *times, *outputs = Py_None, *dict = NULL;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O|O:sample", names, &times, &outputs)) {
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

PyDoc_STRVAR(advance_doc,
             "advance($self, /, seconds)\n--\n\n"
             "Run for about this much wall time [s]; True at the end of the run, else False.\n\n"
             "seconds: >= 0, may be inf; at least one step is made. Runs without the GIL unless a\n"
             "torque is a Python callable, and answers signals every few milliseconds: after\n"
             "KeyboardInterrupt the state is that of a finished step and the run can go on. An\n"
             "exception of a torque callable comes out unchanged and ends the run. After stop()\n"
             "it raises KeyboardInterrupt, whenever called. Raises SimulationError if the run\n"
             "cannot go on, again whenever called again, and RuntimeError if the simulation is\n"
             "running in another call.");

static PyObject *sim_advance(PyObject *object, PyObject *args, PyObject *keywords) {
  char *names[] = {"seconds", NULL};
  bd_core_sim *self = (bd_core_sim *)object;
  PyObject *argument;
  double seconds;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "O:advance", names, &argument) ||
      bd_convert_real(argument, "seconds", &seconds) < 0) {
    return NULL;
  }
  if (!(seconds >= 0)) {
    PyErr_Format(PyExc_ValueError, "seconds must be >= 0, got %R", argument);
    return NULL;
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
    if (bd_core_check_stop(self->stop) < 0) {
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
                      bd_core_check_stop(self->stop) < 0)) {
    return NULL;
  }
  return code < 0 ? bd_core_raise(code, &err) : PyBool_FromLong(code == BD_OK);
}

PyDoc_STRVAR(stop_doc,
             "stop($self, /)\n--\n\n"
             "End the run soon: for other threads, and for callbacks that cannot raise.\n\n"
             "advance() then raises KeyboardInterrupt: after the steps of some milliseconds that\n"
             "it is at, or after the next call of a torque function. It cannot be taken back.\n"
             "The state is that of a finished step. Never waits, and may be called at any time.");

static PyObject *sim_stop(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (self->stop) { /* not cleared by the garbage collector */
    *self->stop = 1;
  }
  Py_RETURN_NONE;
}

/* --- the type -------------------------------------------------------------------------------- */

static PyMethodDef sim_methods[] = {
    {"settle", (PyCFunction)(void (*)(void))sim_settle, METH_VARARGS | METH_KEYWORDS | METH_CLASS,
     settle_doc},
    BD_CORE_KEYWORDS("sample", sim_sample, sample_doc),
    BD_CORE_KEYWORDS("advance", sim_advance, advance_doc),
    {"stop", sim_stop, METH_NOARGS, stop_doc},
    {"state", bd_core_sim_state, METH_NOARGS, bd_core_state_doc},
    {"export_record", bd_core_sim_export, METH_NOARGS, bd_core_export_doc},
    {"import_record", bd_core_sim_import, METH_O, bd_core_import_doc},
    {"time_passes", bd_core_sim_time_passes, METH_O, bd_core_time_passes_doc},
    {NULL, NULL, 0, NULL},
};

PyDoc_STRVAR(
    sim_doc,
    "Simulation(model, state, torque, t_end, *, method='auto', rtol=..., step=0.0,\n"
    "           max_step=0.0, max_steps=0, ledger=True, breakpoints=(),\n"
    "           torque_interval=..., guards=True, motion=())\n--\n\n"
    "One run; not to be used by two threads at once (RuntimeError).\n\n"
    "state: mapping as of state(), copied. torque: sequence of terms that add up,\n"
    "(\"piecewise\", t, values (n_t, n_p)), (\"viscous\", coefficients (n_p,)),\n"
    "(\"function\", address, user_address) of C functions the caller keeps alive, or\n"
    "(\"call\", f) with f(t, theta, omega) -> n_p torques [N m]; theta [rad] and omega\n"
    "[rad/s] are read-only arrays (n_p,). t_end: [s]. rtol: error asked for\n"
    "(adaptive methods). step: of \"rk4\", \"lbdf2\", \"lie\", or the first step [s], 0: chosen.\n"
    "max_step [s] and max_steps: 0: none. ledger: carry the energy ledger. breakpoints:\n"
    "more times [s] at which to stop exactly. torque_interval: longest time between two\n"
    "calls of a function [s]. guards: False, to measure what they cost. motion: of pulleys,\n"
    "(pulley, \"piecewise\", t, values) of the speed [rad/s], (pulley, \"speed\", f) or\n"
    "(pulley, \"angle\", f) with f(t) a number, called for times within the run, some twice.\n"
    "Raises TypeError or ValueError naming the argument.");

static PyType_Slot sim_slots[] = {
    {Py_tp_doc, (void *)sim_doc},           {Py_tp_new, sim_new},
    {Py_tp_traverse, sim_traverse},         {Py_tp_clear, sim_clear},
    {Py_tp_dealloc, sim_dealloc},           {Py_tp_methods, sim_methods},
    {Py_tp_getset, bd_core_sim_properties}, {0, NULL},
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
