find_package(GTest REQUIRED)
include(GoogleTest)

add_executable(picture_test unit/picture_test.cpp)
target_link_libraries(picture_test PRIVATE subworld_picture GTest::gtest_main)
gtest_discover_tests(picture_test DISCOVERY_MODE PRE_TEST)
