/* Moves the handle forwards and back along x. Writes the largest force to the file FAKE_DHD_FORCE when it is closed.
   The file FAKE_DHD_UNPLUGGED stands for a cable that is not connected. */
#include "dhdc.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static double begin_s, largest_n;
static int force_on;

static int unplugged(void) {
  const char* file = getenv("FAKE_DHD_UNPLUGGED");
  return file != NULL && access(file, F_OK) == 0;
}

double dhdGetTime(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int dhdOpen(void) {
  if (unplugged()) return -1;
  begin_s = dhdGetTime();
  return 0;
}

int dhdClose(char id) {
  (void)id;
  const char* name = getenv("FAKE_DHD_FORCE");
  FILE* file = name != NULL ? fopen(name, "w") : NULL;
  if (file == NULL) return 0;
  fprintf(file, "%g\n", largest_n);
  fclose(file);
  return 0;
}

int dhdEnableForce(uchar on, char id) {
  (void)id;
  force_on = on;
  return 0;
}

static const double kWay_m = 0.05, kRate_rad_s = 3.0;

int dhdGetPosition(double* x, double* y, double* z, char id) {
  (void)id;
  if (unplugged()) return -1;
  *x = 0.5 * kWay_m * (1.0 - cos(kRate_rad_s * (dhdGetTime() - begin_s)));
  *y = *z = 0.0;
  return 0;
}

int dhdGetLinearVelocity(double* x, double* y, double* z, char id) {
  (void)id;
  if (unplugged()) return -1;
  *x = 0.5 * kWay_m * kRate_rad_s * sin(kRate_rad_s * (dhdGetTime() - begin_s));
  *y = *z = 0.0;
  return 0;
}

int dhdGetButton(int index, char id) {
  (void)index;
  (void)id;
  return 0;
}

int dhdSetForceAndTorque(double fx, double fy, double fz, double tx, double ty, double tz, char id) {
  (void)tx;
  (void)ty;
  (void)tz;
  (void)id;
  if (unplugged()) return -1;
  const double size_n = sqrt(fx * fx + fy * fy + fz * fz);
  if (force_on && size_n > largest_n) largest_n = size_n;
  return 0;
}

const char* dhdErrorGetLastStr(void) { return "no device found"; }
