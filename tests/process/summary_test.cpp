#include "process/process_test.hpp"

#include <cmath>

namespace subworld::test {
namespace {

class Summary : public ProcessTest {
 protected:
  /// A copy of a scene with one passage replaced.
  [[nodiscard]] std::string edited(const std::string& name, const std::string& passage, const std::string& by) const {
    std::string text = read_text(scene(name));
    const std::size_t at = text.find(passage);
    EXPECT_NE(at, std::string::npos) << passage;
    return folder_.write(name + ".yaml", text.replace(at, passage.size(), by));
  }
};

// A device of 2 N cannot show a press of 12 N: the figures are those of the device, and the run says so.
TEST_F(Summary, TellsWhatTheHandGotAndHowOftenTheDeviceWasAtItsLimit) {
  constexpr double kLimit_n = 2.0;
  const Ended ended =
      run(edited("press", "force_limit_n: 40", "force_limit_n: 2"), {"--mode", "lockstep", "--duration", "1"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json haptic = summary()["haptic"][0];
  const Table table = read_table(out() + "/haptic_0.csv");
  const std::size_t x = table.column("hand_force_x_n");
  double squares = 0.0, most = 0.0, largest_step = 0.0;
  int at_limit = 0;
  std::vector<double> before(table.columns.size(), 0.0);
  for (const auto& row : table.rows) {
    const double force = std::hypot(row[x], row[x + 1], row[x + 2]);
    squares += force * force;
    most = std::max(most, force);
    at_limit += force > kLimit_n * (1.0 - 1e-6);
    largest_step =
        std::max(largest_step, std::hypot(row[x] - before[x], row[x + 1] - before[x + 1], row[x + 2] - before[x + 2]));
    before = row;
  }
  const auto steps = static_cast<double>(table.rows.size());
  ASSERT_GT(at_limit, 0);
  EXPECT_NEAR(most, kLimit_n, 1e-6);
  EXPECT_NEAR(haptic["force_max_n"], most, 1e-6);
  EXPECT_NEAR(haptic["force_rms_n"], std::sqrt(squares / steps), 1e-6);
  EXPECT_NEAR(haptic["force_step_max_n"], largest_step, 1e-6);
  EXPECT_NEAR(haptic["at_limit_ratio"], at_limit / steps, 1e-9);
  // The hand's force ramps in, the coupling's does not.
  EXPECT_GE(haptic["coupling_force_rms_n"], haptic["force_rms_n"]);
  EXPECT_NE(ended.out.find("the hand feels the limit, not the scene"), std::string::npos) << ended.out;
  EXPECT_EQ(summary()["verdict"], "ok") << "a warning is no missed gate";
}

}  // namespace
}  // namespace subworld::test
