// Every misconfiguration that one machine can have, its name, and its cure.
#include "process/faults/doctor_cases.hpp"

namespace subworld::test {
namespace {

class LongDoctor : public Doctor, public ::testing::WithParamInterface<Misconfiguration> {};

TEST_P(LongDoctor, NamesAMisconfigurationAndItsCureWorks) {
  if (!has_namespaces()) GTEST_SKIP() << "needs root and namespaces";
  expect_found_and_cured(GetParam());
}

INSTANTIATE_TEST_SUITE_P(Cases, LongDoctor, ::testing::ValuesIn(misconfigurations()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace subworld::test
