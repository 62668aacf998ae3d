#include "process/process_test.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <map>

namespace subworld::test {
namespace {

constexpr double kGravity_m_s2 = 9.81;

/// A row of bodies.csv.
struct Row {
  double time_s = 0.0;
  std::string body;
  std::vector<double> state;  ///< x y z, qw qx qy qz, velocity, angular velocity
};

std::vector<Row> read_rows(std::istream& stream) {
  std::vector<Row> rows;
  std::string line, cell;
  std::getline(stream, line);
  EXPECT_EQ(line,
            "time_s,body,x_m,y_m,z_m,qw,qx,qy,qz,velocity_x_m_s,velocity_y_m_s,velocity_z_m_s,"
            "angular_velocity_x_rad_s,angular_velocity_y_rad_s,angular_velocity_z_rad_s");
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    Row& row = rows.emplace_back();
    std::getline(cells, cell, ',');
    row.time_s = std::strtod(cell.c_str(), nullptr);
    std::getline(cells, row.body, ',');
    while (std::getline(cells, cell, ',')) row.state.push_back(std::strtod(cell.c_str(), nullptr));
    EXPECT_EQ(row.state.size(), 13U) << line;
    row.state.resize(13);
  }
  return rows;
}

/// Bodies of each instant, by time.
std::map<double, std::vector<std::string>> by_time(const std::vector<Row>& rows) {
  std::map<double, std::vector<std::string>> instants;
  for (const Row& row : rows) instants[row.time_s].push_back(row.body);
  return instants;
}

class Bodies : public ProcessTest {
 protected:
  [[nodiscard]] std::vector<Row> rows() const {
    std::ifstream file(out() + "/bodies.csv");
    EXPECT_TRUE(file) << "no bodies.csv";
    return read_rows(file);
  }
  [[nodiscard]] Json written() const { return summary()["world"]["body_history"]; }

  /// Bodies in the air, and an operator far away.
  [[nodiscard]] std::string in_the_air(const std::string& bodies, const std::string& device = "{}") const {
    return folder_.write("air.yaml",
                         "name: air\n"
                         "settings: {h_s: 0.001, ratio: 4, duration_s: 0.5, settle: {duration_s: 0}}\n"
                         "bodies:\n" +
                             bodies +
                             "users:\n"
                             "  - name: hand\n"
                             "    proxy: {shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2, gravity: false,"
                             " position_m: [-9, 0, 0]}\n"
                             "    device: " +
                             device + "\n");
  }
  /// This number of floating bodies.
  [[nodiscard]] std::string floating(int side) const {
    const std::string n = std::to_string(side);
    return in_the_air(
        "  - {name: ball, shape: sphere, radius_m: 0.05, mass_kg: 0.2, gravity: false,"
        " repeat: {grid: {counts: [" +
        n + ", " + n + ", " + n + "], spacing_m: [0.5, 0.5, 0.5]}}}\n");
  }
};

// A ball without contact: it falls, and turns about its own axis.
TEST_F(Bodies, AFallIsThatOfTheFormula) {
  constexpr double kHeight_m = 5.0, kSpin_rad_s = 3.0, kCycle_s = 0.004;
  const std::string file = in_the_air(
      "  - {name: ball, shape: sphere, radius_m: 0.05, mass_kg: 0.2, position_m: [1, 2, 5],"
      " velocity_m_s: [0.5, 0, 0], angular_velocity_rad_s: [0, 0, 3]}\n");
  ASSERT_EQ(run(file, {"--mode", "lockstep", "--bodies", "ball"}).code, 0);
  const std::vector<Row> fall = rows();
  ASSERT_EQ(fall.size(), 126U) << "t = 0 and 125 cycles";
  for (std::size_t i = 0; i < fall.size(); ++i) {
    const double t = fall[i].time_s;
    const std::vector<double>& s = fall[i].state;
    EXPECT_NEAR(t, kCycle_s * static_cast<double>(i), 1e-9);
    EXPECT_EQ(fall[i].body, "ball");
    EXPECT_NEAR(s[0], 1.0 + 0.5 * t, 1e-6);
    EXPECT_NEAR(s[1], 2.0, 1e-6);
    // An engine that uses the new velocity for the whole step is off by g t T / 2.
    EXPECT_NEAR(s[2], kHeight_m - 0.5 * kGravity_m_s2 * t * t, 0.5 * kGravity_m_s2 * t * kCycle_s + 1e-6) << t;
    EXPECT_NEAR(s[3], std::cos(0.5 * kSpin_rad_s * t), 1e-4) << t;
    EXPECT_NEAR(s[6], std::sin(0.5 * kSpin_rad_s * t), 1e-4) << t;
    EXPECT_NEAR(s[7], 0.5, 1e-6);
    EXPECT_NEAR(s[9], -kGravity_m_s2 * t, 1e-6) << t;
    EXPECT_NEAR(s[12], kSpin_rad_s, 1e-6);
  }
}

// The states from which the world computes its energy. Recording does not change the run.
TEST_F(Bodies, AreThoseOfTheWorldAndDoNotChangeIt) {
  constexpr double kCube_kg = 0.2, kCube_kg_m2 = 0.2 * 0.1 * 0.1 / 6.0, kProxy_kg = 0.1;
  const Words flags{"--mode", "lockstep", "--duration", "0.6"};
  ASSERT_EQ(run(scene("row"), flags).code, 0);
  const Json hash = summary()["state_hash"];
  EXPECT_FALSE(summary()["world"].contains("body_history"));
  EXPECT_FALSE(std::filesystem::exists(out() + "/bodies.csv"));

  Words recorded = flags;
  recorded.insert(recorded.end(), {"--bodies", "all"});
  const Ended ended = run(scene("row"), recorded);
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["state_hash"], hash);
  std::map<double, double> kinetic_j;
  for (const Row& row : rows()) {
    const double v = std::hypot(row.state[7], row.state[8], row.state[9]);
    const double w = std::hypot(row.state[10], row.state[11], row.state[12]);
    const bool is_proxy = row.body == "hand/proxy";
    kinetic_j[row.time_s] += is_proxy ? 0.5 * kProxy_kg * v * v : 0.5 * kCube_kg * v * v + 0.5 * kCube_kg_m2 * w * w;
  }
  const Table world = read_table(out() + "/world.csv");
  ASSERT_EQ(kinetic_j.size(), world.rows.size() + 1) << "t = 0 is before the first cycle";
  const std::size_t energy = world.column("kinetic_energy_j");
  double most_j = 0.0;
  for (const auto& cycle : world.rows) {
    ASSERT_TRUE(kinetic_j.contains(cycle[0])) << cycle[0];
    EXPECT_NEAR(kinetic_j[cycle[0]], cycle[energy], 1e-6 * cycle[energy] + 1e-15) << cycle[0];
    most_j = std::max(most_j, cycle[energy]);
  }
  EXPECT_GT(most_j, 1e-6) << "the row was pushed";
  EXPECT_NEAR(rows().back().time_s, summary()["simulated_s"].get<double>(), 1e-9);

  EXPECT_EQ(written()["file"], "bodies.csv");
  EXPECT_EQ(written()["bodies"], 11);
  EXPECT_EQ(written()["rows"], rows().size());
  EXPECT_EQ(written()["rows_dropped"], 0);
  EXPECT_NE(ended.out.find("bodies.csv: 11 bodies every cycle, 1661 rows"), std::string::npos) << ended.out;
}

TEST_F(Bodies, HaveAPatternAndARate) {
  ASSERT_EQ(run(scene("row"), {"--duration", "0.1", "--bodies", "hand/proxy,cube/?", "--bodies-rate", "50"}).code, 0);
  const auto instants = by_time(rows());
  std::vector<double> times;
  for (const auto& [time_s, bodies] : instants) {
    times.push_back(time_s);
    EXPECT_EQ(bodies, (Words{"cube/0", "cube/1", "cube/2", "cube/3", "cube/4", "cube/5", "cube/6", "cube/7", "cube/8",
                             "cube/9", "hand/proxy"}))
        << time_s;
  }
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.02, 0.04, 0.06, 0.08, 0.1}));
  EXPECT_NEAR(written()["interval_s"].get<double>(), 0.02, 1e-12);

  ASSERT_EQ(run(scene("row"), {"--duration", "0.1", "--bodies", "cube/3", "--bodies-rate", "100000"}).code, 0);
  EXPECT_EQ(rows().size(), 26U) << "more often than once a cycle there is nothing new";
  // A rate that does not fit the cycle: the first cycle after each instant, and the end.
  ASSERT_EQ(run(scene("row"), {"--duration", "0.05", "--bodies", "cube/3", "--bodies-rate", "100"}).code, 0);
  times.clear();
  for (const Row& row : rows()) times.push_back(row.time_s);
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.012, 0.02, 0.032, 0.04, 0.052}));
}

TEST_F(Bodies, OfManyNoMoreThanTenThousandRowsASecondCome) {
  ASSERT_EQ(run(floating(5), {"--mode", "lockstep", "--duration", "0.24", "--bodies", "all"}).code, 0);
  EXPECT_NEAR(written()["interval_s"].get<double>(), 0.016, 1e-12) << "126 bodies: 12.6 ms, in whole cycles of 4 ms";
  EXPECT_EQ(written()["rows"], 126 * 16);
}

// Faster than any file: in lock-step the world waits for it.
TEST_F(Bodies, NoneIsLostInLockStep) {
  ASSERT_EQ(
      run(floating(10), {"--mode", "lockstep", "--duration", "1", "--bodies", "all", "--bodies-rate", "250"}).code, 0);
  EXPECT_EQ(written()["rows"], 1001 * 251);
  EXPECT_EQ(written()["rows_dropped"], 0);
  std::ifstream file(out() + "/bodies.csv");
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(file), {}, '\n'), 1001 * 251 + 1);
}

TEST_F(Bodies, AreThereInRealTime) {
  const Ended ended = run(scene("press"), {"--mode", "realtime", "--duration", "1", "--bodies", "all"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(written()["rows_dropped"], 0);
  EXPECT_EQ(ended.out.find("rows dropped"), std::string::npos) << ended.out;
  const std::vector<Row> all = rows();
  EXPECT_EQ(all.size(), 2 * (summary()["world"]["cycles"].get<std::size_t>() + 1));
  EXPECT_NEAR(all.back().time_s, 1.0, 1e-6);
  for (const auto& [time_s, bodies] : by_time(all)) EXPECT_EQ(bodies, (Words{"cube", "hand/proxy"})) << time_s;
  EXPECT_GT(all.back().state[0], -0.06 + 0.01) << "the proxy did not move";
}

// A file that accepts nothing during the whole run: rows that fit into memory are written at its end, further ones are
// counted, and the run continues.
TEST_F(Bodies, InRealTimeASlowFileDelaysNoLoop) {
  const std::string pipe = folder_.path() + "/pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::filesystem::create_directory(out());
  std::filesystem::create_symlink(pipe, out() + "/bodies.csv");
  const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  Process process(
      run_words(floating(10), {"--mode", "realtime", "--duration", "1", "--bodies", "all", "--bodies-rate", "250"}),
      folder_.path());
  EXPECT_TRUE(eventually([&] {
    const std::string cycles = read_text(out() + "/world.csv");
    return cycles.find("\n1,") != std::string::npos;
  })) << "the world does not come to its end";
  fcntl(reader, F_SETFL, 0);
  std::string text;
  std::array<char, 65536> piece{};
  for (ssize_t got = 1; got > 0;) {
    got = read(reader, piece.data(), piece.size());
    text.append(piece.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  }
  close(reader);
  ASSERT_EQ(process.wait(), 0) << process.err();

  std::istringstream stream(text);
  const auto instants = by_time(read_rows(stream));
  for (const auto& [time_s, bodies] : instants) EXPECT_EQ(bodies.size(), 1001U) << "half an instant at " << time_s;
  const Json json = written();
  EXPECT_EQ(json["rows"], 1001 * instants.size());
  EXPECT_GT(json["rows_dropped"], 0);
  EXPECT_EQ(json["rows"].get<int>() + json["rows_dropped"].get<int>(), 1001 * 251);
  EXPECT_NE(process.out().find("rows dropped, which could not be written in time"), std::string::npos) << process.out();
}

TEST_F(Bodies, WrongOnesAreNamed) {
  const std::vector<std::pair<Words, Words>> wrong{
      {{"--bodies", "cub"}, {"--bodies", "\"cub\"", "did you mean \"cube\"?"}},
      {{"--bodies", "cube,proxy"}, {"\"proxy\"", "did you mean \"hand/proxy\"?"}},
      {{"--bodies", "tower*"}, {"\"tower*\"", "cube*"}},
      {{"--bodies", "all", "--bodies-rate", "0"}, {"--bodies-rate"}},
      {{"--bodies", "all", "--bodies-rate", "nan"}, {"--bodies-rate", "nan"}},
      {{"--bodies-rate", "50"}, {"--bodies-rate", "--bodies"}}};
  for (const auto& [flags, fragments] : wrong) {
    const Ended ended = run(scene("press"), flags);
    EXPECT_EQ(ended.code, 2) << flags.back();
    for (const std::string& fragment : fragments)
      EXPECT_NE(ended.err.find(fragment), std::string::npos) << fragment << " is not in: " << ended.err;
    EXPECT_FALSE(std::filesystem::exists(out())) << "something was started";
  }
  const Ended nowhere = finish({program("world_sim"), scene("press"), "--domain", domain_.text(), "--bodies", "all"});
  EXPECT_EQ(nowhere.code, 2);
  EXPECT_NE(nowhere.err.find("--out"), std::string::npos) << nowhere.err;
}

TEST_F(Bodies, OfAnEarlierRunDoNotStay) {
  ASSERT_EQ(run(scene("press"), {"--duration", "0.05", "--bodies", "cube"}).code, 0);
  ASSERT_TRUE(std::filesystem::exists(out() + "/bodies.csv"));
  ASSERT_EQ(run(scene("press"), {"--duration", "0.05"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(out() + "/bodies.csv"));
}

// A device of 6 degrees of freedom that turns by 90 degrees and pulls a proxy.
TEST_F(Bodies, ADevicesHistoryHasItsTurnAndItsTorque) {
  const std::string file =
      in_the_air("  - {name: floor, shape: plane, fixed: true, position_m: [0, 0, -3]}\n",
                 "{degrees_of_freedom: 6, path: [{turn: {axis: [0, 0, 1], angle_deg: 90}, during_s: [0.2, 0.4]}]}");
  ASSERT_EQ(run(file, {"--mode", "lockstep", "--duration", "0.5"}).code, 0);
  const Table device = read_table(out() + "/device_0.csv");
  EXPECT_EQ(device.column("force_z_n"), 9U) << "columns keep their places";
  const std::size_t q = device.column("qw"), spin = device.column("angular_velocity_z_rad_s"),
                    torque = device.column("torque_z_n_m");
  EXPECT_EQ(q, 10U);
  double most = 0.0, least = 0.0;
  for (const auto& row : device.rows) {
    const double turned = 0.5 * M_PI * std::clamp((row[0] - 0.2) / 0.2, 0.0, 1.0);
    EXPECT_NEAR(row[q], std::cos(0.5 * turned), 1e-6) << row[0];
    EXPECT_NEAR(row[q + 3], std::sin(0.5 * turned), 1e-6) << row[0];
    if (std::abs(row[0] - 0.3) < 0.09) {
      EXPECT_NEAR(row[spin], 0.5 * M_PI / 0.2, 1e-6) << row[0];
    }
    most = std::max(most, row[torque]);
    least = std::min(least, row[torque]);
  }
  EXPECT_LT(least, -1e-3) << "the proxy holds the device back when that sets out";
  EXPECT_GT(most, 1e-3) << "and draws it on when it stops";
}

TEST_F(Bodies, ADeviceThatDoesNotTurnHasTheSameColumns) {
  ASSERT_EQ(run(scene("press"), {"--mode", "lockstep", "--duration", "0.1"}).code, 0);
  const Table device = read_table(out() + "/device_0.csv");
  EXPECT_EQ(device.columns.size(), 20U);
  const std::size_t q = device.column("qw");
  for (const auto& row : device.rows) {
    EXPECT_EQ(row[q], 1.0);
    for (std::size_t i = q + 1; i < row.size(); ++i) EXPECT_EQ(row[i], 0.0);
  }
}

}  // namespace
}  // namespace subworld::test
