find_package(GTest REQUIRED)
include(GoogleTest)

add_executable(wire_unit_test unit/wire_codec_test.cpp unit/wire_topics_test.cpp unit/wire_allocation_test.cpp)
target_include_directories(wire_unit_test PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(wire_unit_test PRIVATE subworld_wire GTest::gtest_main)
gtest_discover_tests(wire_unit_test DISCOVERY_MODE PRE_TEST)

# A program that writes until it is killed, for tests of liveliness.
add_executable(wire_writer_helper interop/wire_writer_helper.cpp)
target_link_libraries(wire_writer_helper PRIVATE subworld_wire)

add_executable(wire_interop_test interop/wire_exchange_test.cpp interop/wire_events_test.cpp interop/wire_open_test.cpp)
target_include_directories(wire_interop_test PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(wire_interop_test PRIVATE subworld_wire GTest::gtest_main)
add_dependencies(wire_interop_test wire_writer_helper)
# Discovery and leases are a matter of time: a few at once, so that a small machine keeps up.
gtest_discover_tests(wire_interop_test DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT 60 LABELS interop PROCESSORS 1)
