// Programs of one run die and are halted at random, and come back; between hosts, cables are pulled too. Nobody else is
// affected, and nothing is lost. Longer, or with other seeds: SUBWORLD_CHURN_FAULTS and SUBWORLD_CHURN_SEED.
#include "process/sessions/sessions.hpp"
#include "support/grid.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
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

/// A host for the world, and one for each user.
std::string four_hosts(const std::string& scene_file, const std::string& domain) {
  std::string text = fmt::format("name: four_hosts\nscene: {}\ndomain: {}\nhosts:\n", scene_file, domain) +
                     "  - {name: world, address: 10.0.0.1, interface: eth0, programs: [world_sim]}\n";
  for (int user = 0; user < kUsers; ++user) {
    text += fmt::format(
        "  - {{name: user_{0}, address: 10.0.0.{1}, interface: eth0, programs: [haptic_sim {0}, device_sim {0}]}}\n",
        user, user + 2);
  }
  return text;
}

enum class Fault { kill, halt, cut };

/// A program that dies, is halted, or whose host has its cable pulled.
struct Victim {
  std::string program;
  int user = -1;  ///< -1: the world
};

struct ChurnCase {
  const char* dds;
  bool hosts = false;    ///< on four hosts
  bool secured = false;  ///< by keys
};

std::string name_of(const ChurnCase& one) {
  return std::string(one.dds) + (one.hosts ? "_on_four_hosts" : "") + (one.secured ? "_secured" : "");
}

class Churn : public Sessions, public ::testing::WithParamInterface<ChurnCase> {
 protected:
  [[nodiscard]] Words words(double duration_s) const {
    const std::string file = folder_.write("three_on_a_cube.yaml", three_on_a_cube());
    Words flags{"--dds", GetParam().dds, "--restart", "on-failure"};
    if (GetParam().secured) {
      const std::string keys = folder_.path() + "/keys";
      EXPECT_EQ(finish({program("subworld"), "keys", "make", keys, "--users", std::to_string(kUsers)}).code, 0);
      flags.insert(flags.end(), {"--secure", keys});
    }
    Words words;
    if (GetParam().hosts) {
      words = up(folder_.write("session.yaml", four_hosts(file, domain_.text()) +
                                                   fmt::format("flags: {{mode: realtime, duration: {}, checkpoint: "
                                                               "0.2}}\n",
                                                               duration_s)),
                 out(), {"--namespaces"});
    } else {
      words =
          run_words(file, {"--mode", "realtime", "--duration", fmt::format("{}", duration_s), "--checkpoint", "0.2"});
    }
    words.insert(words.end(), flags.begin(), flags.end());
    return words;
  }
  /// Simulated time of the world so far, s, from its history.
  [[nodiscard]] double world_s() const {
    return last_number(out() + (GetParam().hosts ? "/hosts/world" : "") + "/world.csv");
  }
  /// The network interface of the host of a program is switched off or on.
  void set_link(pid_t inside, const char* state) const {
    const Ended ended =
        finish({"/usr/bin/nsenter", "--target", std::to_string(inside), "--net", "ip", "link", "set", "eth0", state});
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
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
  /// Resident memory of a program of the run, MB.
  [[nodiscard]] static double memory_mb(pid_t pid) {
    long pages = 0, resident = 0;
    std::ifstream(fmt::format("/proc/{}/statm", pid)) >> pages >> resident;
    return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) * 1e-6;
  }
  /// Rows whose time is not at least so much later than that of the row before.
  [[nodiscard]] static std::size_t steps_back(const Table& table, double least_s = 0.0) {
    std::size_t back = 0;
    for (std::size_t i = 1; i < table.rows.size(); ++i) back += table.rows[i][0] - table.rows[i - 1][0] < least_s;
    return back;
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
  /// Longest time in which the force on an operator fell to zero, and when that began, s; the device stands.
  [[nodiscard]] static std::pair<double, double> longest_fade(const Table& table) {
    const std::size_t x = table.column("force_x_n");
    const auto force_n = [&](std::size_t i) {
      return std::hypot(table.rows[i][x], table.rows[i][x + 1], table.rows[i][x + 2]);
    };
    // A killed or halted program writes no rows; its force is what the device's own watchdog makes of it.
    const auto runs_on = [&](std::size_t i) { return table.rows[i][0] - table.rows[i - 1][0] < 0.05; };
    double longest_s = 0.0, at_s = 0.0;
    for (std::size_t zero = 1; zero < table.rows.size(); ++zero) {
      if (force_n(zero) > 0.0 || force_n(zero - 1) == 0.0 || !runs_on(zero)) continue;
      std::size_t from = zero - 1;
      while (from > 0 && runs_on(from) && force_n(from - 1) > force_n(from) + 1e-3) --from;
      const double fade_s = table.rows[zero][0] - table.rows[from][0];
      if (fade_s <= longest_s) continue;
      longest_s = fade_s;
      at_s = table.rows[from][0];
    }
    return {longest_s, at_s};
  }
};

TEST_P(Churn, AffectsNobodyElseAndLosesNothing) {
  const int faults = number_from("SUBWORLD_CHURN_FAULTS", 4);
  std::mt19937 random(static_cast<unsigned>(number_from("SUBWORLD_CHURN_SEED", 1)));
  const auto draw = [&](int below) { return static_cast<int>(random() % static_cast<unsigned>(below)); };
  const double duration_s = 3.0 + 2.2 * faults;
  if (GetParam().hosts && !has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  Process run(words(duration_s), folder_.path());
  ASSERT_TRUE(eventually([&] { return world_s() > 1.5; })) << run.err();
  std::vector<int> disturbed(kUsers, 0);  // by user: faults of its own programs, or of the world
  std::vector<double> world_away_s;
  int kills = 0, halts = 0, cuts = 0, world_halts = 0;
  std::map<pid_t, double> first_mb;  // of each program, when it has run for a fault at least
  double grown_mb = 0.0;
  const auto watch_memory = [&] {
    for (const Running& one : running(out())) {
      const double now_mb = memory_mb(one.pid);
      const auto [first, is_new] = first_mb.try_emplace(one.pid, 0.0);
      if (first->second == 0.0 && !is_new) first->second = now_mb;
      if (first->second > 0.0) grown_mb = std::max(grown_mb, now_mb - first->second);
    }
  };
  for (int i = 0; i < faults && world_s() < duration_s - 3.0; ++i) {  // a user has time to return
    const int which = draw(7), user = draw(kUsers);
    const Victim victim = which == 0 ? Victim{"world_sim", -1} : Victim{which < 4 ? "haptic_sim" : "device_sim", user};
    const Fault fault = GetParam().hosts && draw(3) == 0 ? Fault::cut : draw(3) != 0 ? Fault::kill : Fault::halt;
    pid_t pid = -1;
    ASSERT_TRUE(eventually([&] { return (pid = pid_of(victim)) > 0; })) << victim.program << run.err();
    const double at_s = world_s();
    const int away_ms = 200 + draw(500);
    const char* const what = fault == Fault::kill ? "killed" : fault == Fault::halt ? "halted" : "cut off";
    fmt::print("t = {:.3f} s: {} {} is {}\n", at_s, victim.program, victim.user, what);
    for (int u = 0; u < kUsers; ++u) disturbed[u] += victim.user < 0 || victim.user == u;
    const auto away = [&] { std::this_thread::sleep_for(std::chrono::milliseconds(away_ms)); };
    switch (fault) {
      case Fault::halt:
        ++halts;
        world_halts += victim.user < 0;
        kill(pid, SIGSTOP);
        away();
        kill(pid, SIGCONT);
        break;
      case Fault::cut:
        ++cuts;
        set_link(pid, "down");
        away();
        set_link(pid, "up");
        break;
      case Fault::kill:
        ++kills;
        kill(pid, SIGKILL);
        if (victim.user >= 0) break;
        const auto killed = std::chrono::steady_clock::now();
        ASSERT_TRUE(eventually([&] { return world_s() > at_s + 0.1; })) << run.err();
        world_away_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - killed).count());
        break;
    }
    watch_memory();
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
  EXPECT_LE(steps_back(read_table(out() + "/world.csv"), 1e-6), world_away_s.size()) << "a cycle was computed twice";
  EXPECT_LT(grown_mb, 10.0) << "memory of a program";
  std::string steps, fades;
  for (int u = 0; u < kUsers; ++u) {
    EXPECT_LE(absences[u], disturbed[u]) << "user " << u << " was absent without a fault of its own programs";
    const std::string history = fmt::format("{}/haptic_{}.csv", out(), u);
    const Table table = read_table(history);
    EXPECT_LE(steps_back(table), world_away_s.size()) << history << ": only a restarted world goes back";
    EXPECT_LT(table.rows.front()[0], 0.2) << history << " has lost its beginning";
    EXPECT_GT(table.rows.back()[0], duration_s - 0.3) << history;
    const auto [step_n, at_s] = largest_step(table);
    EXPECT_LT(step_n, 0.3) << "user " << u << " has felt it at t = " << at_s << " s";
    const auto [fade_s, fades_s] = longest_fade(read_table(fmt::format("{}/device_{}.csv", out(), u)));
    // Where the world is away, the haptic loop declutches; without the haptic loop, the device fades faster.
    const bool declutches = world_halts > 0 || cuts > 0 || !world_away_s.empty();
    EXPECT_LT(fade_s, declutches ? 0.032 : 0.0065) << "the force on user " << u << " at t = " << fades_s << " s";
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
      "{}: {} killed, {} halted, {} cut off; users absent {}; world away {}; largest force steps{} N; longest fades{} "
      "ms; largest growth of a program {:.1f} MB\n{}\n",
      name_of(GetParam()), kills, halts, cuts, text(absent_s), text(world_away_s), steps, fades, grown_mb, verdict);
}

const Halves<ChurnCase> kCases = halves<ChurnCase>({{"fastdds"},
                                                    {"cyclonedds"},
                                                    {"mixed"},
                                                    {"fastdds", true},
                                                    {"cyclonedds", true},
                                                    {"mixed", true},
                                                    {"fastdds", false, true},
                                                    {"cyclonedds", false, true}},
                                                   3);
std::string name_of_case(const ::testing::TestParamInfo<ChurnCase>& one) { return name_of(one.param); }
INSTANTIATE_TEST_SUITE_P(Vendors, Churn, ::testing::ValuesIn(kCases.half), name_of_case);
INSTANTIATE_TEST_SUITE_P(FullRealtime, Churn, ::testing::ValuesIn(kCases.other), name_of_case);

}  // namespace
}  // namespace subworld::test
