/* SPDX-License-Identifier: MIT
 *
 * The arrays a run fills: allocated by NumPy before it, written by the core while it goes on.
 * Guarded by tests/test_module_run.py (shapes, contents) and tests/test_lifetime.py (who owns
 * them).
 */
#include "binding/binding.h"

#include <math.h>
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

/* A fresh (rows, columns) array, filled. It is kept in `keep`; the dict gets a view, which cannot
 * be resized. */
static void *add_output(PyObject *keep, PyObject *dict, const char *name, int type, npy_intp rows,
                        npy_intp columns) {
  const npy_intp shape[2] = {rows, columns};
  void *data = NULL;
  PyArrayObject *array = (PyArrayObject *)PyArray_SimpleNew(2, shape, type);
  if (array && fill(PyArray_DATA(array), type, PyArray_SIZE(array)) == 0 &&
      PyList_Append(keep, (PyObject *)array) == 0 &&
      bd_core_set(dict, name, PyArray_View(array, NULL, NULL)) == 0) {
    data = PyArray_DATA(array);
  }
  Py_XDECREF(array);
  return data;
}

enum { WIDTH_PULLEYS, WIDTH_LINKS, WIDTH_FRICTION, WIDTH_MOUNTS, WIDTH_ENERGY };

int bd_core_output_new(bd_output *output, PyObject *keep, PyObject *dict, const bd_info *info,
                       int n_energy, npy_intp rows) {
  const npy_intp width[] = {
      [WIDTH_PULLEYS] = info->n_pulleys,
      [WIDTH_LINKS] = info->n_bodies,
      [WIDTH_FRICTION] = info->n_slots > 0 ? info->n_bodies : 0,
      [WIDTH_MOUNTS] = info->n_mounts,
      [WIDTH_ENERGY] = n_energy,
  };
#define X(name, group, size, unit, text)                                                           \
  if (width[WIDTH_##size]) {                                                                       \
    output->name = add_output(keep, dict, #name, NPY_DOUBLE, rows, width[WIDTH_##size]);           \
    if (!output->name)                                                                             \
      return -1;                                                                                   \
  }
  BD_OUTPUTS(X)
#undef X
  output->pulley = add_output(keep, dict, "pulley", NPY_INT32, rows, width[WIDTH_LINKS]);
  return output->pulley ? 0 : -1;
}
