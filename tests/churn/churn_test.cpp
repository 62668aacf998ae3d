// Programs of one run die and are halted at random, and come back: nobody else is affected, and nothing is lost.
// Longer, or with other seeds: SUBWORLD_CHURN_FAULTS and SUBWORLD_CHURN_SEED.
#include "process/process_test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
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

/// A program that dies, or is halted.
struct Victim {
  std::string program;
  int user = -1;  ///< -1: the world
};

class Churn : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Simulated time of the world so far, s, from its history.
  [[nodiscard]] double world_s() const { return last_number(out() + "/world.csv"); }
  /// The first number of the last whole row of a history; 0: there is none. Histories get long.
  static double last_number(const std::string& file) {
    std::ifstream stream(file, std::ios::ate);
    const auto size = static_cast<std::streamoff>(stream.tellg());
    stream.seekg(std::max<std::streamoff>(0, size - 1000));
    std::string tail((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    const std::size_t end = tail.rfind('\n');
    if (size <= 0 || end == std::string::npos) return 0.0;
    const std::size_t begin = tail.rfind('\n', end - 1);
    return begin == std::string::npos ? 0.0 : std::atof(tail.c_str() + begin + 1);
  }
  [[nodiscard]] pid_t pid_of(const Victim& victim) const {
    for (const Running& one : running(out())) {
      if (!one.words.front().ends_with("/" + victim.program)) continue;
      const auto at = std::find(one.words.begin(), one.words.end(), "--user");
      const bool has_user = at != one.words.end() && at + 1 != one.words.end();
      if (victim.user < 0 || (has_user && *(at + 1) == std::to_string(victim.user))) return one.pid;
    }
    return -1;
  }
  /// Largest step of the coupling's force on a user while all devices stand: N, and its time, s. A restarted world goes
  /// back by some cycles; over that the force steps as little. Only a user's own absence is no step.
  [[nodiscard]] static std::pair<double, double> largest_step(const Table& table) {
    const std::size_t time = table.column("time_s"), x = table.column("force_x_n");
    double largest_n = 0.0, at_s = 0.0;
    for (std::size_t i = 1; i < table.rows.size(); ++i) {
      const auto &before = table.rows[i - 1], &now = table.rows[i];
      if (before[time] < kStands_s || now[time] - before[time] > 0.1) continue;
      double squared = 0.0;
      for (std::size_t k = x; k < x + 3; ++k) squared += (now[k] - before[k]) * (now[k] - before[k]);
      if (std::sqrt(squared) <= largest_n) continue;
      largest_n = std::sqrt(squared);
      at_s = now[time];
    }
    return {largest_n, at_s};
  }
  /// Longest time in which the force on an operator fell to zero, s; the device stands.
  [[nodiscard]] static double longest_fade_s(const Table& table) {
    const std::size_t x = table.column("force_x_n");
    const auto force_n = [&](std::size_t i) {
      return std::hypot(table.rows[i][x], table.rows[i][x + 1], table.rows[i][x + 2]);
    };
    double longest_s = 0.0;
    for (std::size_t zero = 1; zero < table.rows.size(); ++zero) {
      if (force_n(zero) > 0.0 || force_n(zero - 1) == 0.0) continue;
      std::size_t from = zero - 1;
      while (from > 0 && force_n(from - 1) > force_n(from) + 1e-3) --from;
      longest_s = std::max(longest_s, table.rows[zero][0] - table.rows[from][0]);
    }
    return longest_s;
  }
};

TEST_P(Churn, AffectsNobodyElseAndLosesNothing) {
  const int faults = number_from("SUBWORLD_CHURN_FAULTS", 5);
  std::mt19937 random(static_cast<unsigned>(number_from("SUBWORLD_CHURN_SEED", 1)));
  const auto draw = [&](int below) { return static_cast<int>(random() % static_cast<unsigned>(below)); };
  const double duration_s = 3.0 + 2.2 * faults;
  const std::string file = folder_.write("three_on_a_cube.yaml", three_on_a_cube());
  Process run(run_words(file, {"--mode", "realtime", "--dds", GetParam(), "--duration", fmt::format("{}", duration_s),
                               "--restart", "on-failure", "--checkpoint", "0.2"}),
              folder_.path());
  ASSERT_TRUE(eventually([&] { return world_s() > 1.5; })) << run.err();
  std::vector<int> disturbed(kUsers, 0);  // by user: faults of its own programs, or of the world
  std::vector<double> world_away_s;
  int kills = 0, halts = 0, world_halts = 0;
  for (int i = 0; i < faults && world_s() < duration_s - 3.0; ++i) {  // a user has time to return
    const int which = draw(7), user = draw(kUsers);
    const Victim victim = which == 0 ? Victim{"world_sim", -1} : Victim{which < 4 ? "haptic_sim" : "device_sim", user};
    const bool kills_it = draw(3) != 0;
    pid_t pid = -1;
    ASSERT_TRUE(eventually([&] { return (pid = pid_of(victim)) > 0; })) << victim.program << run.err();
    const double at_s = world_s();
    fmt::print("t = {:.3f} s: {} {} is {}\n", at_s, victim.program, victim.user, kills_it ? "killed" : "halted");
    for (int u = 0; u < kUsers; ++u) disturbed[u] += victim.user < 0 || victim.user == u;
    kills += kills_it;
    halts += !kills_it;
    world_halts += !kills_it && victim.user < 0;
    kill(pid, kills_it ? SIGKILL : SIGSTOP);
    if (!kills_it) {
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + draw(500)));
      kill(pid, SIGCONT);
    } else if (victim.user < 0) {
      const auto killed = std::chrono::steady_clock::now();
      ASSERT_TRUE(eventually([&] { return world_s() > at_s + 0.1; })) << run.err();
      world_away_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - killed).count());
    }
    const double next_s = std::max(world_s(), at_s) + 1.3 + 0.001 * draw(300);
    ASSERT_TRUE(eventually([&] { return world_s() > next_s || world_s() > duration_s - 0.1; })) << run.err();
  }
  ASSERT_EQ(run.wait(60.0 + duration_s), 0) << run.err() << run.out();

  const Json json = summary();
  const std::string verdict = json["verdict"];
  EXPECT_FALSE(verdict.starts_with("unstable") || verdict.starts_with("failed")) << verdict;
  EXPECT_EQ(json.value("restarts", Json::array()).size(), static_cast<std::size_t>(kills)) << verdict;
  std::vector<double> absent_s;
  std::vector<int> absences(kUsers, 0);
  for (const Json& absence : json["world"]["absences"]) {
    const double from_s = absence["from_s"], to_s = absence["to_s"];
    EXPECT_LT(to_s, duration_s - 0.01) << "user " << absence["user"] << " has not returned";
    ++absences[absence["user"].get<std::size_t>()];
    absent_s.push_back(to_s - from_s);
  }
  std::string steps, fades;
  for (int u = 0; u < kUsers; ++u) {
    EXPECT_LE(absences[u], disturbed[u]) << "user " << u << " was absent without a fault of its own programs";
    const std::string history = fmt::format("{}/haptic_{}.csv", out(), u);
    const Table table = read_table(history);
    std::size_t back = 0;
    for (std::size_t i = 1; i < table.rows.size(); ++i) back += table.rows[i][0] < table.rows[i - 1][0];
    EXPECT_LE(back, world_away_s.size()) << history << ": only a restarted world goes back";
    EXPECT_LT(table.rows.front()[0], 0.2) << history << " has lost its beginning";
    EXPECT_GT(table.rows.back()[0], duration_s - 0.3) << history;
    const auto [step_n, at_s] = largest_step(table);
    EXPECT_LT(step_n, 0.3) << "user " << u << " has felt it at t = " << at_s << " s";
    const double fade_s = longest_fade_s(read_table(fmt::format("{}/device_{}.csv", out(), u)));
    // Where the world is away, the haptic loop declutches; without the haptic loop, the device fades faster.
    EXPECT_LT(fade_s, world_halts > 0 || !world_away_s.empty() ? 0.032 : 0.0065) << "the force on user " << u;
    steps += fmt::format(" {:.4f}", step_n);
    fades += fmt::format(" {:.0f}", 1e3 * fade_s);
  }
  const auto text = [](std::vector<double> times) {
    if (times.empty()) return std::string("-");
    std::sort(times.begin(), times.end());
    return fmt::format("{} times, p50 {:.2f} s, p99 {:.2f} s, max {:.2f} s", times.size(), times[times.size() / 2],
                       times[times.size() * 99 / 100], times.back());
  };
  fmt::print(
      "{}: {} killed, {} halted; users absent {}; world away {}; largest force steps{} N; longest fades{} ms\n{}\n",
      GetParam(), kills, halts, text(absent_s), text(world_away_s), steps, fades, verdict);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Churn, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
