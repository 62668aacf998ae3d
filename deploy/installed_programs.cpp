// Compiled into each program that links an installed library of Subworld: common/model/places.cpp.
extern "C" const char* subworld_installed_programs();
extern "C" const char* subworld_installed_programs() { return SUBWORLD_PROGRAMS; }
