# Subworld::lab (the whole system in one process), ::world, ::haptic and ::device (what the programs of these names simulate),
# ::model (scenes), ::physics (engines), ::coupling, ::wire, ::io, ::rt. Subworld_PROGRAMS is the folder of the programs and plug-ins.
include(CMakeFindDependencyMacro)
foreach(package Eigen3 fmt yaml-cpp assimp nlohmann_json ZLIB Threads)
  find_dependency(${package})
endforeach()
include(${CMAKE_CURRENT_LIST_DIR}/SubworldTargets.cmake)
get_filename_component(Subworld_PROGRAMS ${CMAKE_CURRENT_LIST_DIR}/../../subworld ABSOLUTE)
# The bits of a result are those of the programs only where inline functions are compiled as there.
set_property(TARGET Subworld::model APPEND PROPERTY INTERFACE_COMPILE_FEATURES cxx_std_20)
set_property(TARGET Subworld::model APPEND PROPERTY INTERFACE_COMPILE_OPTIONS -ffp-contract=off)
# They find the engines, the DDS vendors and the scenes of this installation.
set_property(TARGET Subworld::model APPEND PROPERTY INTERFACE_SOURCES ${CMAKE_CURRENT_LIST_DIR}/installed_programs.cpp)
set_property(TARGET Subworld::model APPEND PROPERTY INTERFACE_COMPILE_DEFINITIONS SUBWORLD_PROGRAMS="${Subworld_PROGRAMS}")
