// Compiled into each program that links an installed library of Subworld: common/model/places.cpp.
extern "C" const char* const subworld_installed_programs;
const char* const subworld_installed_programs = SUBWORLD_PROGRAMS;
