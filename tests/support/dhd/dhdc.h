/* The few functions of Force Dimension's SDK that device_sim/example/dhd.cpp uses, for tests without the SDK. */
#pragma once
#ifdef __cplusplus
extern "C" {
#endif
typedef unsigned char uchar;
#define DHD_ON 1
#define DHD_OFF 0
#define DHD_TIMEGUARD 1
int dhdOpen(void);
int dhdClose(char id);
int dhdEnableForce(uchar on, char id);
int dhdGetPosition(double* x, double* y, double* z, char id);
int dhdGetLinearVelocity(double* x, double* y, double* z, char id);
int dhdGetButton(int index, char id);
int dhdSetForceAndTorque(double fx, double fy, double fz, double tx, double ty, double tz, char id);
double dhdGetTime(void);
const char* dhdErrorGetLastStr(void);
#ifdef __cplusplus
}
#endif
