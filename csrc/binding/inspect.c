/* SPDX-License-Identifier: MIT
 *
 * What a Simulation shows between its steps: state, restart record, counters, warnings, passes and
 * what they cost. Guarded by tests/test_module_run.py and tests/test_record.py.
 */
#include "binding/simulation.h"

#include <limits.h>
#include <math.h>

PyObject *bd_core_sim_state(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  bd_state state;
  if (bd_core_enter(self) < 0) {
    return NULL;
  }
  PyObject *dict = bd_core_state_new(&state, &self->model->info);
  if (dict) {
    bd_sim_state(self->sim, &state);
  }
  bd_core_leave(self);
  return bd_core_state_timed(dict, &state);
}

PyObject *bd_core_sim_export(PyObject *object, PyObject *Py_UNUSED(none)) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (bd_core_enter(self) < 0) {
    return NULL;
  }
  PyObject *bytes = NULL;
  const size_t size = self->settling ? 0 : bd_sim_export(self->sim, NULL);
  if (size > 0) {
    bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)size);
  } else {
    PyErr_SetString(PyExc_RuntimeError,
                    self->settling
                        ? "settling has no restart record: begin it anew"
                        : "a run that ended in an error or in an exception of its torque function "
                          "has no restart record: it may have been in the middle of a step");
  }
  if (bytes) {
    bd_sim_export(self->sim, PyBytes_AS_STRING(bytes));
  }
  bd_core_leave(self);
  return bytes;
}

PyObject *bd_core_sim_import(PyObject *object, PyObject *record) {
  bd_core_sim *self = (bd_core_sim *)object;
  PyObject *result = NULL;
  Py_buffer view;
  if (PyObject_GetBuffer(record, &view, PyBUF_SIMPLE) < 0) {
    return NULL;
  }
  if (bd_core_enter(self) == 0) {
    bd_error err = {0};
    const int code = bd_sim_import(self->sim, view.buf, (size_t)view.len, &err);
    bd_core_leave(self);
    self->started |= code >= 0;
    result = bd_core_result(Py_NewRef(Py_None), code, &err);
  }
  PyBuffer_Release(&view);
  return result;
}

/* --- properties ------------------------------------------------------------------------------ */

static PyObject *read_time(bd_core_sim *self) {
  return PyFloat_FromDouble(bd_sim_time(self->sim));
}

static PyObject *read_samples(bd_core_sim *self) {
  return PyLong_FromSize_t(bd_sim_samples(self->sim));
}

static PyObject *read_stats(bd_core_sim *self) {
  bd_stats stats = {0};
  bd_sim_stats(self->sim, &stats);
  PyObject *dict = PyDict_New();
#define X(type, name, text) BD_CORE_SET_VALUE(dict, stats, name)
  BD_STATS(X)
#undef X
  return dict;
}

static PyObject *read_method(bd_core_sim *self) {
  return PyUnicode_FromString(bd_sim_method(self->sim));
}

static PyObject *read_choice(bd_core_sim *self) {
  char text[384];
  bd_sim_explain(self->sim, text, sizeof text);
  return PyUnicode_FromString(text);
}

static PyObject *read_sizes(bd_core_sim *self) {
  bd_sizes sizes;
  bd_sim_sizes(self->sim, &sizes);
  return Py_BuildValue("{s:n, s:n, s:n}", "state", (Py_ssize_t)sizes.state, "works",
                       (Py_ssize_t)sizes.works, "bytes", (Py_ssize_t)sizes.bytes);
}

static PyObject *warning_dict(const bd_warning *w, const bd_model *model) {
  bd_label where = {""};
  if (w->pulley >= 0) {
    where = bd_pulley_label(model, w->pulley);
  } else if (w->body >= 0) {
    where = bd_body_label(model, w->body);
  }
  PyObject *t = isnan(w->t) ? Py_NewRef(Py_None) : PyFloat_FromDouble(w->t);
  return t ? Py_BuildValue("{s:s, s:s, s:N, s:s, s:O}", "code", bd_warning_code(w->code), "text",
                           w->message, "t", t, "where", where.text, "accuracy",
                           bd_warning_accuracy(w->code) ? Py_True : Py_False)
           : NULL;
}

static PyObject *read_warnings(bd_core_sim *self) {
  PyObject *list = PyList_New(0);
  bd_warning w;
  for (size_t k = 0; list && bd_sim_warning(self->sim, k, &w); k++) {
    list = bd_core_append(list, warning_dict(&w, self->model->model));
  }
  return list;
}

/* A property: by one of the functions above, whose address the closure holds. */
typedef PyObject *(*read_property)(bd_core_sim *self);

static PyObject *sim_property(PyObject *object, void *closure) {
  bd_core_sim *self = (bd_core_sim *)object;
  if (bd_core_enter(self) < 0) {
    return NULL;
  }
  PyObject *value = (*(const read_property *)closure)(self);
  bd_core_leave(self);
  return value;
}

#define PROPERTY(name, text)                                                                       \
  {                                                                                                \
#name, sim_property, NULL, text " RuntimeError while running.", &(read_property) {             \
      read_##name                                                                                  \
    }                                                                                              \
  }

/* Fixed when the simulation is made, so this may be read while it runs. */
static PyObject *sim_passes(PyObject *object, void *Py_UNUSED(closure)) {
  return Py_NewRef(((bd_core_sim *)object)->passes);
}

static PyObject *sim_effects(PyObject *object, void *Py_UNUSED(closure)) {
  const bd_core_sim *self = (bd_core_sim *)object;
  PyObject *list = PyList_New(0);
  for (int k = 0; self->sim && bd_sim_effect(self->sim, k) >= 0; k++) {
    list = bd_core_append(list, PyLong_FromLong(bd_sim_effect(self->sim, k)));
  }
  return bd_core_tuple(list);
}

PyObject *bd_core_sim_time_passes(PyObject *object, PyObject *argument) {
  bd_core_sim *self = (bd_core_sim *)object;
  long rounds;
  if (bd_convert_long(argument, "rounds", &rounds) < 0 || bd_core_enter(self) < 0) {
    return NULL;
  }
  bd_pass_time times[BD_MAX_PASSES];
  bd_error err = {0};
  int n = 0;
  const int asked = rounds > INT_MAX ? INT_MAX : rounds < 0 ? 0 : (int)rounds;
  PyThreadState *thread = self->n_calls ? NULL : PyEval_SaveThread();
  const int code = bd_sim_time_passes(self->sim, asked, times, &n, &err);
  if (thread) {
    PyEval_RestoreThread(thread);
  }
  bd_core_leave(self);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  PyObject *list = PyList_New(0);
  for (int k = 0; list && k < n; k++) {
    list = bd_core_append(list,
                          Py_BuildValue("(sdd)", times[k].name, times[k].calls, times[k].seconds));
  }
  return list;
}

PyGetSetDef bd_core_sim_properties[] = {
    PROPERTY(time, "Simulated time reached [s]."),
    PROPERTY(samples, "Finished sample rows."),
    PROPERTY(method, "Integration method in use."),
    PROPERTY(choice, "Why that method, a sentence."),
    PROPERTY(sizes, "Numbers in the state vector and works in it, bytes of the simulation."),
    PROPERTY(stats, "Counters as in STATS, a new dict."),
    PROPERTY(warnings, "What was noticed so far: dicts of code, text, t, where, accuracy."),
    {"passes", sim_passes, NULL, "Names of the passes of the plan, in order.", NULL},
    {"effects", sim_effects, NULL, "Rows of EFFECTS that the plan has, in order of its passes.",
     NULL},
    {NULL, NULL, NULL, NULL, NULL},
};
