// Programs of one run die and are halted at random, and come back: nobody else is affected, and nothing is lost.
// Longer, or with other seeds: SUBWORLD_CHURN_FAULTS and SUBWORLD_CHURN_SEED.
#include "process/process_test.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <random>
#include <thread>

namespace subworld::test {
namespace {

constexpr int kUsers = 3;
constexpr double kStands_s = 1.2;  ///< from then on no device moves, and forces are constant

/// Three operators press one cube, and stand.
std::string three_on_a_cube() {
  const auto user = [](const char* name, const char* at, const char* move) {
    return fmt::format(
        "  - name: {}\n"
        "    proxy: {{shape: sphere, radius_m: 0.03, mass_kg: 0.1, position_m: {}, rotates: false, gravity: false, "
        "material: plain}}\n"
        "    coupling: {{stiffness_n_m: 1000, damping_n_s_m: 20}}\n"
        "    box_half_m: 0.2\n"
        "    device: {{force_limit_n: 40, path: [{{move: {}, during_s: [0.2, 0.9]}}]}}\n",
        name, at, move);
  };
  return "name: three_on_a_cube\n"
         "settings:\n"
         "  h_s: 0.001\n"
         "  ratio: 4\n"
         "  duration_s: 2\n"
         "  world: {engine: bullet, preset: fast, iterations: 50}\n"
         "  haptic: {engine: bullet, preset: fast, iterations: 50}\n"
         "materials: {plain: {friction: 0.5, restitution: 0}}\n"
         "bodies:\n"
         "  - {name: floor, shape: plane, fixed: true, material: plain}\n"
         "  - {name: cube, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2, material: plain, position_m: [0, 0, "
         "0.05]}\n"
         "users:\n" +
         user("left", "[-0.10, 0, 0.05]", "[0.03, 0, 0]") + user("right", "[0.10, 0, 0.05]", "[-0.03, 0, 0]") +
         user("above", "[0, 0, 0.15]", "[0, 0, -0.03]");
}

int number_from(const char* variable, int otherwise) {
  const char* const text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

class Churn : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Simulated time of the world so far, s, from its history.
  [[nodiscard]] double world_s() const {
    const Table table = read_table(out() + "/world.csv");
    return table.rows.empty() ? 0.0 : table.rows.back()[0];
  }
  [[nodiscard]] pid_t pid_of(const std::string& name, int user) const {
    for (const Running& one : running(out())) {
      const bool is_it = one.words.front().ends_with("/" + name);
      const auto at = std::find(one.words.begin(), one.words.end(), "--user");
      if (is_it && at != one.words.end() && at + 1 != one.words.end() && *(at + 1) == std::to_string(user))
        return one.pid;
    }
    return -1;
  }
  /// Largest step of the coupling's force on a user while all devices stand and that user's own programs run: N, and
  /// its time, s.
  [[nodiscard]] std::pair<double, double> largest_step(int user) const {
    const Table table = read_table(fmt::format("{}/haptic_{}.csv", out(), user));
    const std::size_t time = table.column("time_s"), x = table.column("force_x_n");
    double largest_n = 0.0, at_s = 0.0;
    for (std::size_t i = 1; i < table.rows.size(); ++i) {
      const auto &before = table.rows[i - 1], &now = table.rows[i];
      if (before[time] < kStands_s || now[time] - before[time] > 0.1) continue;  // it was away
      double squared = 0.0;
      for (std::size_t k = x; k < x + 3; ++k) squared += (now[k] - before[k]) * (now[k] - before[k]);
      if (std::sqrt(squared) <= largest_n) continue;
      largest_n = std::sqrt(squared);
      at_s = now[time];
    }
    return {largest_n, at_s};
  }
};

TEST_P(Churn, OfAUserAffectsNobodyElseAndLosesNothing) {
  const int faults = number_from("SUBWORLD_CHURN_FAULTS", 4);
  std::mt19937 random(static_cast<unsigned>(number_from("SUBWORLD_CHURN_SEED", 1)));
  const auto draw = [&](int below) { return static_cast<int>(random() % static_cast<unsigned>(below)); };
  // The user whose programs die; the two others are watched.
  const int victim = draw(kUsers);
  const double duration_s = 3.0 + 2.0 * faults;
  const std::string file = folder_.write("three_on_a_cube.yaml", three_on_a_cube());
  Process run(run_words(file, {"--mode", "realtime", "--dds", GetParam(), "--duration", fmt::format("{}", duration_s),
                               "--restart", "on-failure"}),
              folder_.path());
  ASSERT_TRUE(eventually([&] { return world_s() > 1.5; })) << run.err();
  int kills = 0, halts = 0;
  for (int i = 0; i < faults; ++i) {
    const std::string name = draw(2) == 0 ? "haptic_sim" : "device_sim";
    const bool kills_it = draw(3) != 0;
    pid_t pid = -1;
    ASSERT_TRUE(eventually([&] { return (pid = pid_of(name, victim)) > 0; })) << name << run.err();
    if (kills_it) {
      ++kills;
      fmt::print("t = {:.3f} s: {} {} is killed\n", world_s(), name, victim);
      kill(pid, SIGKILL);
    } else {
      ++halts;
      fmt::print("t = {:.3f} s: {} {} is halted\n", world_s(), name, victim);
      kill(pid, SIGSTOP);
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + draw(500)));
      kill(pid, SIGCONT);
    }
    const double next_s = world_s() + 1.5 + 0.001 * draw(300);
    ASSERT_TRUE(eventually([&] { return world_s() > next_s || world_s() > duration_s - 0.1; })) << run.err();
  }
  ASSERT_EQ(run.wait(60.0), 0) << run.err() << run.out();
  const Json json = summary();
  const std::string verdict = json["verdict"];
  EXPECT_FALSE(verdict.starts_with("unstable") || verdict.starts_with("failed")) << verdict;
  EXPECT_EQ(json.value("restarts", Json::array()).size(), static_cast<std::size_t>(kills)) << verdict;
  EXPECT_LE(json["world"]["absences"].size(), static_cast<std::size_t>(kills + halts));
  double longest_s = 0.0;
  for (const Json& absence : json["world"]["absences"]) {
    EXPECT_EQ(absence["user"], victim);
    EXPECT_LT(absence["to_s"].get<double>(), duration_s - 0.01) << "it did not return";
    longest_s = std::max(longest_s, absence["to_s"].get<double>() - absence["from_s"].get<double>());
  }
  std::string steps;
  for (int u = 0; u < kUsers; ++u) {
    const std::string history = fmt::format("{}/haptic_{}.csv", out(), u);
    const Table table = read_table(history);
    for (std::size_t i = 1; i < table.rows.size(); ++i)
      ASSERT_LE(table.rows[i - 1][0], table.rows[i][0]) << history << ", row " << i;
    EXPECT_LT(table.rows.front()[0], 0.2) << history << " has lost its beginning";
    EXPECT_GT(table.rows.back()[0], duration_s - 0.3) << history;
    const auto [step_n, at_s] = largest_step(u);
    steps += fmt::format(" {:.3f}", step_n);
    if (u == victim) continue;
    EXPECT_LT(step_n, 0.3) << "user " << u << " has felt it at t = " << at_s << " s";
  }
  fmt::print("{}: {} killed, {} halted, programs of user {}; longest absence {:.3f} s; largest force steps{} N; {}\n",
             GetParam(), kills, halts, victim, longest_s, steps, verdict);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Churn, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
