find_package(GTest REQUIRED)
include(GoogleTest)

add_library(scene_test_support STATIC support/box_overlap.cpp)
target_include_directories(scene_test_support PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(scene_test_support PUBLIC subworld_model)

foreach(name scene_error scene_library scene_path scene_mass)
  add_executable(${name}_test unit/${name}_test.cpp)
  target_link_libraries(${name}_test PRIVATE scene_test_support subworld_model fmt::fmt GTest::gtest_main)
  target_compile_definitions(${name}_test PRIVATE SCENES_FOLDER="${PROJECT_SOURCE_DIR}/deploy/scenes")
  gtest_discover_tests(${name}_test)
endforeach()
