/* SPDX-License-Identifier: MIT
 *
 * The parts of a scene, read from the arguments of Model; and the belt line, which needs the
 * pulleys alone. Guarded by tests/test_module.py.
 */
#include "binding/binding.h"

#include <limits.h>
#include <string.h>

/* --- groups of parameters -------------------------------------------------------------------- */

static int read_list(PyObject *value, const char *name, bd_numbers *list) {
  if (!PyTuple_Check(value)) {
    return bd_convert_refuse(value, name, "a tuple of numbers");
  }
  if (PyTuple_GET_SIZE(value) > BD_MAX_ELEMENTS) {
    PyErr_Format(PyExc_ValueError, "%s must have 1 to %d numbers, got %zd", name, BD_MAX_ELEMENTS,
                 PyTuple_GET_SIZE(value));
    return -1;
  }
  list->n = (int)PyTuple_GET_SIZE(value);
  for (int e = 0; e < list->n; e++) {
    char label[BD_NAME_SIZE];
    PyOS_snprintf(label, sizeof label, "%s[%d]", name, e);
    if (bd_convert_real(PyTuple_GET_ITEM(value, e), label, &list->at[e]) < 0) {
      return -1;
    }
  }
  return 0;
}

/* The core checks the rule itself. */
static int read_parameter(PyObject *value, const char *label, const bd_parameter *row,
                          char *record) {
  char name[BD_NAME_SIZE];
  PyOS_snprintf(name, sizeof name, "%s.%s", label, row->name);
  if (row->kind == BD_IS_LIST) {
    bd_numbers list = {0};
    if (read_list(value, name, &list) < 0) {
      return -1;
    }
    memcpy(record + row->offset, &list, sizeof list);
    return 0;
  }
  if (row->kind == BD_IS_NUMBER) {
    double number;
    if (bd_convert_real(value, name, &number) < 0) {
      return -1;
    }
    memcpy(record + row->offset, &number, sizeof number);
    return 0;
  }
  long count;
  if (bd_convert_long(value, name, &count) < 0) {
    return -1;
  }
  if (count < INT_MIN || count > INT_MAX) {
    PyErr_Format(PyExc_ValueError, "%s is too large: %ld", name, count);
    return -1;
  }
  int integer = (int)count;
  memcpy(record + row->offset, &integer, sizeof integer);
  return 0;
}

int bd_core_read_group(PyObject *object, const char *group, const char *label, void *record) {
  Py_ssize_t count = 0;
  for (size_t k = 0; k < bd_n_parameters; k++) {
    count += !strcmp(bd_parameters[k].group, group);
  }
  if (!PyTuple_Check(object)) {
    PyErr_Format(PyExc_TypeError, "%s must be a tuple of %zd numbers, got %.100s", label, count,
                 Py_TYPE(object)->tp_name);
    return -1;
  }
  if (PyTuple_GET_SIZE(object) != count) {
    PyErr_Format(PyExc_ValueError, "%s must have %zd numbers, got %zd", label, count,
                 PyTuple_GET_SIZE(object));
    return -1;
  }
  Py_ssize_t at = 0;
  for (size_t k = 0; k < bd_n_parameters; k++) {
    if (!strcmp(bd_parameters[k].group, group) &&
        read_parameter(PyTuple_GET_ITEM(object, at++), label, &bd_parameters[k], record) < 0) {
      return -1;
    }
  }
  return 0;
}

int bd_core_read_friction(PyObject *object, const char *label, bd_friction *friction) {
  if (object == Py_None) {
    return 0;
  }
  const char *name = PyTuple_Check(object) && PyTuple_GET_SIZE(object) == 2 &&
                             PyUnicode_Check(PyTuple_GET_ITEM(object, 0))
                         ? PyUnicode_AsUTF8(PyTuple_GET_ITEM(object, 0))
                         : NULL;
  if (!name) {
    if (!PyErr_Occurred()) {
      PyErr_Format(PyExc_TypeError, "%s must be a tuple (name of the law, its numbers), got %R",
                   label, object);
    }
    return -1;
  }
  friction->law = bd_law_find(name);
  if (friction->law < 0) {
    PyErr_Format(PyExc_ValueError, "%s: there is no friction law '%s'", label, name);
    return -1;
  }
  return bd_core_read_group(PyTuple_GET_ITEM(object, 1), name, label, &friction->dahl);
}

/* What a pulley points to; of a name that is too long, enough for the core to refuse it. */
typedef struct {
  bd_friction friction;
  char name[BD_MAX_NAME + 2];
  bd_mount mount;
  bd_coupling coupling;
  PyObject *keep; /* borrowed */
} owned;

/* What one pulley has of an argument that has an entry for each of them. */
typedef int (*read_entry)(PyObject *entry, const char *label, bd_pulley *pulley, owned *own);

static int read_drag(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  (void)own;
  return bd_core_read_group(entry, "drag", label, &pulley->drag);
}

static int read_own_friction(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  pulley->friction = &own->friction;
  return bd_core_read_friction(entry, label, &own->friction);
}

static int read_outside(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  (void)own;
  return bd_convert_bool(entry, label, &pulley->outside);
}

static int read_name(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  const char *text = NULL;
  if (bd_convert_text(entry, label, &text) < 0) {
    if (text) { /* a null character */
      PyErr_Format(PyExc_ValueError, "%s must be printable, got %R", label, entry);
    }
    return -1;
  }
  PyOS_snprintf(own->name, sizeof own->name, "%s", text);
  pulley->name = own->name;
  return 0;
}

static int read_mount(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  pulley->mount = &own->mount;
  return bd_core_read_mount(entry, label, &own->mount, own->keep);
}

/* A tuple of the name of its group and its numbers. */
static int read_coupling(PyObject *entry, const char *label, bd_pulley *pulley, owned *own) {
  const char *kind = NULL;
  PyObject *numbers;
  pulley->coupling = &own->coupling;
  if (!PyTuple_Check(entry) || !PyArg_ParseTuple(entry, "sO", &kind, &numbers)) {
    PyErr_Format(PyExc_TypeError,
                 "%s must be a tuple (\"isolator\", \"clutch\" or \"damper\", numbers), got %R",
                 label, entry);
    return -1;
  }
  for (int k = 0; k < BD_N_COUPLINGS; ++k) {
    if (strcmp(kind, bd_coupling_name(k)) == 0) {
      own->coupling.kind = k;
      return bd_core_read_group(numbers, kind, label, &own->coupling.isolator);
    }
  }
  PyErr_Format(PyExc_ValueError,
               "%s must be an \"isolator\", a \"clutch\" or a \"damper\", got \"%.50s\"", label,
               kind);
  return -1;
}

/* One entry, or None, for each pulley; None: no pulley has any. */
static int read_entries(PyObject *object, const char *name, read_entry read, npy_intp count,
                        bd_pulley *pulleys, owned *own) {
  if (object == Py_None) {
    return 0;
  }
  PyObject *rows = PySequence_Check(object) && !PyUnicode_Check(object)
                       ? PySequence_Fast(object, "must be a sequence")
                       : NULL;
  if (!rows) {
    return PyErr_Occurred() ? -1 : bd_convert_refuse(object, name, "a sequence of tuples");
  }
  int failed = 0;
  if (PySequence_Fast_GET_SIZE(rows) != count) {
    PyErr_Format(PyExc_ValueError, "%s must have one entry for each of %zd pulleys, got %zd", name,
                 (Py_ssize_t)count, PySequence_Fast_GET_SIZE(rows));
    failed = -1;
  }
  for (Py_ssize_t j = 0; !failed && j < count; j++) {
    PyObject *row = PySequence_Fast_GET_ITEM(rows, j);
    char label[BD_NAME_SIZE];
    PyOS_snprintf(label, sizeof label, "pulleys[%d].%s", (int)j, name);
    failed = row == Py_None ? 0 : read(row, label, &pulleys[j], &own[j]);
  }
  Py_DECREF(rows);
  return failed;
}

bd_pulley *bd_core_read_pulleys(PyObject *centers, PyObject *radii, PyObject *inertias,
                                const bd_core_pulley_parts *parts, PyObject *keep, int *n) {
  const npy_intp pairs[2] = {BD_ANY, 2};
  bd_pulley *pulleys = NULL;
  PyArrayObject *center = bd_convert_array(centers, "centers", 2, pairs), *radius = NULL,
                *inertia = NULL;
  if (!center) {
    return NULL;
  }
  npy_intp count = PyArray_DIM(center, 0);
  if (count > INT_MAX) {
    PyErr_SetString(PyExc_ValueError, "centers has too many rows");
    goto out;
  }
  radius = bd_convert_array(radii, "radii", 1, &count);
  if (!radius) {
    goto out;
  }
  inertia = bd_convert_array(inertias, "inertias", 1, &count);
  if (!inertia) {
    goto out;
  }
  pulleys = PyMem_Calloc((size_t)count, sizeof *pulleys + sizeof(owned));
  if (!pulleys) {
    PyErr_NoMemory();
    goto out;
  }
  const double *c = PyArray_DATA(center), *r = PyArray_DATA(radius), *i = PyArray_DATA(inertia);
  for (npy_intp j = 0; j < count; j++) {
    pulleys[j] = (bd_pulley){
        .center = {c[2 * j], c[2 * j + 1]},
        .radius = r[j],
        .inertia = i[j],
    };
  }
  owned *own = (owned *)(pulleys + count);
  for (npy_intp j = 0; j < count; j++) {
    own[j].keep = keep;
  }
  if (read_entries(parts->drag, "drag", read_drag, count, pulleys, own) < 0 ||
      read_entries(parts->friction, "friction", read_own_friction, count, pulleys, own) < 0 ||
      read_entries(parts->outside, "outside", read_outside, count, pulleys, own) < 0 ||
      read_entries(parts->names, "name", read_name, count, pulleys, own) < 0 ||
      read_entries(parts->mounts, "mount", read_mount, count, pulleys, own) < 0 ||
      read_entries(parts->couplings, "coupling", read_coupling, count, pulleys, own) < 0) {
    PyMem_Free(pulleys);
    pulleys = NULL;
  }
  *n = (int)count;
out:
  Py_DECREF(center);
  Py_XDECREF(radius);
  Py_XDECREF(inertia);
  return pulleys;
}

/* --- belt line ------------------------------------------------------------------------------- */

PyObject *bd_core_belt_line(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  PyObject *centers, *radii;
  bd_core_pulley_parts parts = {Py_None, Py_None, Py_None, Py_None, Py_None, Py_None};
  const bd_argument arguments[] = {{"centers", BD_OBJECT, &centers},
                                   {"radii", BD_OBJECT, &radii},
                                   {"outside", BD_OBJECT, &parts.outside},
                                   {"names", BD_OBJECT, &parts.names},
                                   {0}};
  if (bd_convert_arguments(args, keywords, "belt_line", 2, 4, arguments) < 0) {
    return NULL;
  }
  int n = 0, turns = 0;
  double length = 0.0;
  bd_pulley *pulleys = bd_core_read_pulleys(centers, radii, radii, &parts, NULL, &n);
  if (!pulleys) {
    return NULL;
  }
  PyObject *rows = NULL;
  bd_error err = {0};
  bd_wrap *wraps = PyMem_Calloc((size_t)n + 1, sizeof *wraps);
  if (!wraps) {
    PyErr_NoMemory();
  } else if (n == 0) {
    PyErr_SetString(PyExc_ValueError, "centers must have at least one row");
  } else if (bd_belt_line(n, pulleys, wraps, &length, &turns, &err) < 0) {
    bd_core_raise(err.code, &err);
  } else {
    rows = PyList_New(0);
  }
  for (int j = 0; rows && j < n; j++) {
    const bd_wrap *wrap = &wraps[j];
    rows = bd_core_append(
        rows, Py_BuildValue("(dddi)", wrap->arrive, wrap->wrap, wrap->span, wrap->sense));
  }
  rows = bd_core_tuple(rows);
  PyMem_Free(wraps);
  PyMem_Free(pulleys);
  return rows ? Py_BuildValue("(Ndi)", rows, length, turns) : NULL;
}
