# Most of the compiler's time goes into headers. Those that nearly every unit reads are compiled once for each set of
# options, unless CMAKE_DISABLE_PRECOMPILE_HEADERS is set: the preset `dev` shows which source lacks an include.
set(subworld_headers
    <algorithm> <array> <atomic> <bit> <charconv> <chrono> <cmath> <condition_variable> <filesystem> <fstream> <functional>
    <iostream> <map> <memory> <mutex> <numeric> <optional> <ranges> <set> <span> <sstream> <string> <thread> <unordered_map>
    <variant> <vector> <Eigen/Core> <Eigen/Geometry> <fmt/core.h> <model/messages/exchange.hpp> <model/joined.hpp> <model/scene/scene.hpp>)

# subworld_precompiled(name option... [LINK library...] [HEADERS further headers...])
function(subworld_precompiled name)
  cmake_parse_arguments(ARG "" "" "LINK;HEADERS" ${ARGN})
  set(empty ${CMAKE_BINARY_DIR}/precompiled/${name}.cpp)
  if(NOT EXISTS ${empty})
    file(WRITE ${empty} "")
  endif()
  add_library(${name} OBJECT ${empty})
  target_include_directories(${name} PRIVATE ${CMAKE_BINARY_DIR}/rooms/model)  # the room itself uses this
  target_link_libraries(${name} PRIVATE Eigen3::Eigen fmt::fmt ${ARG_LINK})
  target_compile_options(${name} PRIVATE ${ARG_UNPARSED_ARGUMENTS})
  target_precompile_headers(${name} PRIVATE ${subworld_headers} ${ARG_HEADERS})
endfunction()

# For all targets of a folder and of the folders in it.
function(subworld_use_precompiled folder)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  list(FILTER targets EXCLUDE REGEX "^precompiled_")
  foreach(target ${targets})
    get_target_property(type ${target} TYPE)
    get_target_property(sources ${target} SOURCES)
    get_target_property(options ${target} COMPILE_OPTIONS)
    get_target_property(libraries ${target} LINK_LIBRARIES)
    if(NOT type MATCHES "LIBRARY|EXECUTABLE" OR NOT sources MATCHES "\\.cpp" OR options MATCHES "-fsanitize=thread|-fnon-call")
      continue()
    endif()
    if(libraries MATCHES "GTest::gtest" AND options MATCHES "-O0")
      set(headers precompiled_tests)
    elseif(options MATCHES "-O1" AND NOT options MATCHES "-O3")
      set(headers precompiled_cold)
    else()
      set(headers precompiled_hot)
    endif()
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endforeach()
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(inner ${folders})
    subworld_use_precompiled(${inner})
  endforeach()
endfunction()

subworld_precompiled(precompiled_hot)
subworld_precompiled(precompiled_cold $<$<CONFIG:Release>:-O1>)
if(BUILD_TESTING)
  find_package(GTest REQUIRED)
  find_package(nlohmann_json REQUIRED)
  subworld_precompiled(precompiled_tests $<$<CONFIG:Release>:-O0> LINK GTest::gtest nlohmann_json::nlohmann_json
                       HEADERS <gtest/gtest.h> <nlohmann/json.hpp>)
endif()
subworld_use_precompiled(${PROJECT_SOURCE_DIR})
