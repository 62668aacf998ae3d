#pragma once

#include "process/process_test.hpp"
#include "support/grid.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <ostream>
#include <thread>

namespace subworld::test {

/// One program with its own folder for output.
struct Started {
  std::string name;
  std::unique_ptr<Process> process;
};

/// The programs of a run of scene `press`, each started by hand.
class ByHandEnds : public ProcessTest {
 protected:
  void TearDown() override {
    started_.clear();
    ProcessTest::TearDown();
  }

  Process& start(const std::string& name, const Words& flags = {}, const Environment& environment = {}) {
    const std::string folder = folder_.path() + "/" + std::to_string(started_.size()) + "_" + name;
    std::filesystem::create_directories(folder);
    Words words{program(name), scene("press"), "--domain", domain_.text()};
    words.insert(words.end(), common_.begin(), common_.end());
    words.insert(words.end(), flags.begin(), flags.end());
    started_.push_back({name, std::make_unique<Process>(words, folder, environment)});
    return *started_.back().process;
  }
  /// World, haptic process and device, in the middle of their loops.
  void start_run(const std::string& mode, const std::string& dds, const Words& flags = {}) {
    common_ = {"--mode", mode, "--dds", dds, "--duration", "1000"};
    common_.insert(common_.end(), flags.begin(), flags.end());
    world_ = &start("world_sim");
    haptic_ = &start("haptic_sim", {"--out", out()});
    device_ = &start("device_sim");
    ASSERT_TRUE(eventually([&] {
      return mode == "realtime" ? haptic_->out().find(" Hz") != std::string::npos
                                : read_text(out() + "/haptic_0.csv").size() > 10000;
    })) << haptic_->err();
    if (mode == "realtime") std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }

  Words common_;
  std::vector<Started> started_;
  Process* world_ = nullptr;
  Process* haptic_ = nullptr;
  Process* device_ = nullptr;
};

/// A program that is killed.
struct Loss {
  std::string mode;
  std::string dds;
  std::string victim;
};
inline void PrintTo(const Loss& one, std::ostream* out) { *out << one.mode << " " << one.dds << " " << one.victim; }
inline std::string name_of(const ::testing::TestParamInfo<Loss>& one) {
  return one.param.mode + "_" + one.param.dds + "_" + one.param.victim;
}
/// Each program with each vendor.
inline Halves<Loss> losses(const std::string& mode) {
  std::vector<Loss> all;
  for (const char* dds : {"fastdds", "cyclonedds"}) {
    for (const char* victim : {"world_sim", "haptic_sim", "device_sim"}) all.push_back({mode, dds, victim});
  }
  return halves(all, 3);
}

/// A run of the launcher, and an event in one of its programs.
class RunEnds : public ProcessTest {
 protected:
  void start(const std::string& mode, const std::string& dds, const std::string& duration, const Words& flags = {}) {
    Words all{"--mode", mode, "--dds", dds, "--duration", duration};
    all.insert(all.end(), flags.begin(), flags.end());
    process_.emplace(run_words(scene("press"), all), folder_.path());
    // Each program writes its history ten times a second.
    ASSERT_TRUE(eventually([&] {
      return read_text(out() + "/haptic_0.csv").size() > 10000 && read_text(out() + "/device_0.csv").size() > 1000 &&
             read_text(out() + "/world.csv").size() > 1000;
    })) << process_->err();
  }
  /// To all processes of this program.
  void signal(const std::string& name, int number) const {
    for (const Running& one : running(out())) {
      if (one.words.front().ends_with("/" + name)) kill(one.pid, number);
    }
  }
  std::optional<Process> process_;
};

}  // namespace subworld::test
