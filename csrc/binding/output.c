/* SPDX-License-Identifier: MIT
 *
 * The arrays a run fills: allocated by NumPy before it, written by the core while it goes on.
 * Guarded by tests/test_module_run.py (shapes, contents) and tests/test_lifetime.py (who owns
 * them).
 */
#include "binding/binding.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static void fill_slab(void *data, int type, npy_intp begin, npy_intp end) {
  if (type == NPY_INT32) {
    memset((npy_int32 *)data + begin, 0xff, (size_t)(end - begin) * sizeof(npy_int32));
    return;
  }
  for (npy_intp k = begin; k < end; k++) {
    ((double *)data)[k] = NAN;
  }
}

/* Fills with the value that means "not written yet", NaN or -1, in slabs of some milliseconds with
 * a look at the signals between them and without the GIL: getting the memory for a million rows
 * takes seconds. Nobody else knows the array yet. */
static int fill(void *data, int type, npy_intp n) {
  const npy_intp slab = 1 << 18;
  for (npy_intp i = 0; i < n; i += slab) {
    Py_BEGIN_ALLOW_THREADS;
    fill_slab(data, type, i, n - i < slab ? n : i + slab);
    Py_END_ALLOW_THREADS;
    if (PyErr_CheckSignals() < 0) {
      return -1;
    }
  }
  return 0;
}

/* A fresh (rows, columns) array, of vectors (rows, columns, 2), filled. It is kept in `keep`; the
 * dict gets a view, which cannot be resized. */
static void *add_output(PyObject *keep, PyObject *dict, const char *name, int type, npy_intp rows,
                        npy_intp columns, int vectors) {
  const npy_intp shape[3] = {rows, columns, 2};
  void *data = NULL;
  PyArrayObject *array = (PyArrayObject *)PyArray_SimpleNew(vectors ? 3 : 2, shape, type);
  if (array && fill(PyArray_DATA(array), type, PyArray_SIZE(array)) == 0 &&
      PyList_Append(keep, (PyObject *)array) == 0 &&
      bd_core_set(dict, name, PyArray_View(array, NULL, NULL)) == 0) {
    data = PyArray_DATA(array);
  }
  Py_XDECREF(array);
  return data;
}

/* The outputs: the member of bd_output, of numbers or of indices. */
static const struct {
  const char *name;
  int size;
  size_t offset;
  int type;
  int by_default;
} outputs[] = {
#define X(name, group, size, unit, text)                                                           \
  {#name, BD_SIZE_##size, offsetof(bd_output, name), NPY_DOUBLE, 1},
    BD_OUTPUTS(X)
#undef X
        {"pulley", BD_SIZE_CONTACT, offsetof(bd_output, pulley), NPY_INT32, 1},
    {"span_tension", BD_SIZE_PULLEYS, offsetof(bd_output, span_tension), NPY_DOUBLE, 0},
    {"across", BD_SIZE_ONE, offsetof(bd_output, across), NPY_DOUBLE, 0},
};
enum { N_OUTPUTS = sizeof outputs / sizeof outputs[0] };

static int is_output(const char *name) {
  int found = 0;
  for (int k = 0; name && k < N_OUTPUTS; k++) {
    found |= strcmp(name, outputs[k].name) == 0;
  }
  return found;
}

PyObject *bd_core_output_names(PyObject *names) {
  PyObject *all = NULL;
  if (PyUnicode_Check(names)) {
    PyErr_SetString(PyExc_TypeError, "outputs must be a sequence of names, got a str");
  } else {
    all = PySequence_Tuple(names);
  }
  for (Py_ssize_t k = 0; all && k < PyTuple_GET_SIZE(all); k++) {
    PyObject *item = PyTuple_GET_ITEM(all, k);
    if (!is_output(PyUnicode_Check(item) ? PyUnicode_AsUTF8(item) : NULL)) {
      PyErr_Clear();
      PyErr_Format(PyExc_ValueError, "outputs: there is no output %R", item);
      Py_CLEAR(all);
    }
  }
  return all;
}

/* Is this one of the names? -1 with an exception. */
static int is_named(PyObject *names, const char *name) {
  PyObject *text = PyUnicode_FromString(name);
  const int found = text ? PySequence_Contains(names, text) : -1;
  Py_XDECREF(text);
  return found;
}

int bd_core_output_new(bd_output *output, PyObject *keep, PyObject *dict, const bd_info *info,
                       int n_energy, npy_intp rows, PyObject *names) {
  for (int k = 0; k < N_OUTPUTS; k++) {
    const int wanted = names ? is_named(names, outputs[k].name) : outputs[k].by_default;
    const int size = outputs[k].size;
    const npy_intp width = size == BD_SIZE_ENERGY ? n_energy : (npy_intp)bd_size(info, size);
    if (wanted < 0) {
      return -1;
    }
    if (!wanted || !width) {
      continue;
    }
    void *data = add_output(keep, dict, outputs[k].name, outputs[k].type, rows, width,
                            size == BD_SIZE_PLANE);
    if (!data) {
      return -1;
    }
    memcpy((char *)output + outputs[k].offset, &data, sizeof data);
  }
  return 0;
}

PyObject *bd_core_span_tension(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  PyObject *touched_object, *force_object;
  long np = 0;
  const bd_argument rows[] = {{"pulley", BD_OBJECT, &touched_object},
                              {"force", BD_OBJECT, &force_object},
                              {"n_pulleys", BD_LONG, &np},
                              {0}};
  if (bd_convert_arguments(args, keywords, "span_tension", 3, 3, rows) < 0) {
    return NULL;
  }
  /* not bd_convert_array: forces of a failed run may be infinite */
  PyArrayObject *touched =
      (PyArrayObject *)PyArray_FROM_OTF(touched_object, NPY_INT32, NPY_ARRAY_IN_ARRAY);
  PyArrayObject *force =
      touched ? (PyArrayObject *)PyArray_FROM_OTF(force_object, NPY_DOUBLE, NPY_ARRAY_IN_ARRAY)
              : NULL;
  PyArrayObject *tension = NULL;
  if (force && (PyArray_NDIM(touched) != 2 || !PyArray_SAMESHAPE(touched, force) || np < 1 ||
                np > BD_MAX_PULLEYS || PyArray_DIM(force, 1) > BD_MAX_LINKS)) {
    PyErr_SetString(PyExc_ValueError,
                    "pulley and force must have one shape (n_t, n_b), n_pulleys be > 0");
  } else if (force) {
    const npy_intp shape[2] = {PyArray_DIM(force, 0), np};
    tension = (PyArrayObject *)PyArray_SimpleNew(2, shape, NPY_DOUBLE);
  }
  const npy_intp n = tension ? PyArray_DIM(force, 1) : 0;
  for (npy_intp k = 0; tension && k < PyArray_DIM(tension, 0); k++) {
    bd_span_tension((int)n, (const npy_int32 *)PyArray_DATA(touched) + k * n,
                    (const double *)PyArray_DATA(force) + k * n, (int)np,
                    (double *)PyArray_DATA(tension) + k * np);
  }
  Py_XDECREF(touched);
  Py_XDECREF(force);
  return (PyObject *)tension;
}
