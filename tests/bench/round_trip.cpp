// Cost of a world frame and its report, beside a plain exchange of the same number of bytes: the same vendor, quality
// of service and transport, alternating cycle by cycle, in one run. Two processes: a world, and a sub-world that
// answers each frame at once.

#include "device_sim/emulated_device.hpp"
#include "haptic_sim/sub_world.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/histogram.hpp"
#include "wire/bus.hpp"
#include "wire/codec/codec.hpp"
#include "wire/plugin.hpp"
#include "world_sim/world.hpp"

#include <fmt/core.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace subworld;

constexpr double kPatience_s = 20.0;

/// Shared memory of both processes.
struct Shared {
  std::atomic<int> answered{-1};  ///< cycles: the sub-world waits for the next one
  std::atomic<int> received{-1};  ///< cycles whose report the world has received
  Histogram decode, apply, describe, send;
};

class Sink final : public wire::EventSink {
 public:
  void report(wire::Event, std::uint64_t, const char*, const char*, const char*) noexcept override {}
  void wake() noexcept override {
    {
      const std::lock_guard lock(mutex_);
      ++changes_;
    }
    changed_.notify_one();
  }
  void wait() noexcept {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::milliseconds(10), [this] { return changes_ != seen_; });
    seen_ = changes_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t changes_ = 0, seen_ = 0;
};

/// Throws `Error` (failed) if the other side does not respond.
template <class There, class Wait>
void await(There there, Wait wait) {
  const TimePoint until = Clock::now() + from_seconds(kPatience_s);
  while (!there()) {
    if (Clock::now() > until) throw Error(ExitCode::failed, "the other process does not answer");
    wait();
  }
}

void short_sleep() { std::this_thread::sleep_for(std::chrono::microseconds(100)); }

/// Exchange of bytes with the back end only.
class Bare {
 public:
  Bare(const BusConfig& config, bool asks) : backend_(wire::load_plugin(config.vendor)(wire::prepare(config), sink_)) {
    const auto spec = [&](TopicSpec topic, const char* name) {
      topic.name = name;
      return wire::EndpointSpec{topic, qos_of(topic, config.mode, config.device_period_s, config.cycle_s), {}};
    };
    writer_ = backend_->create_writer(asks ? spec(kTopicOf<WorldFrame>, "bare_frame")
                                           : spec(kTopicOf<HapticReport>, "bare_report"));
    reader_ = backend_->create_reader(asks ? spec(kTopicOf<HapticReport>, "bare_report")
                                           : spec(kTopicOf<WorldFrame>, "bare_frame"));
  }

  [[nodiscard]] bool matched() const { return writer_->matched() > 0 && reader_->matched() > 0; }
  void send(std::span<const std::uint8_t> bytes) { writer_->write(bytes); }
  void receive() {
    std::uint64_t writer = 0;
    await([&] { return reader_->take(bytes_, writer); }, [&] { sink_.wait(); });
  }

 private:
  Sink sink_;
  std::unique_ptr<wire::Backend> backend_;
  std::unique_ptr<wire::BackendWriter> writer_;
  std::unique_ptr<wire::BackendReader> reader_;
  std::vector<std::uint8_t> bytes_;
};

template <class M>
void receive(Bus& bus, Reader<M>& reader, M& sample) {
  await([&] { return reader.take(sample) == Take::sample; }, [&] { bus.wait(0.01); });
}

void answer(const Scene& scene, const BusConfig& config, int cycles, Shared& shared) {
  SubWorld sub(scene, 0);
  EmulatedDevice device(scene.users[0].device, 0);
  const std::unique_ptr<Bus> bus = open_bus(config);
  Reader<WorldFrame> frames = bus->reader<WorldFrame>();
  Writer<HapticReport> reports = bus->writer<HapticReport>();
  Bare bare(config, false);
  Codec<HapticReport> codec;
  WorldFrame frame;
  reserve(frame, kUsualMembers);
  await([&] { return bare.matched() && frames.matched() > 0 && reports.matched() > 0; }, [&] { bus->wait(0.01); });
  const double h = scene.settings.h_s;
  shared.answered = 0;
  receive(*bus, frames, frame);
  sub.synchronise_with(frame);
  reports.write(*sub.close_cycle(0));
  for (int cycle = 1; cycle <= cycles; ++cycle) {
    do {
      const DeviceState state = device.state();
      const FeltStep felt = sub.step(
          {.device = &state, .wall_s = h, .dt = h}, [](const FeltStep&) {}, [] {});
      device.step(sub.command_for(state, felt.to_operator), h);
    } while (!sub.clock().at_boundary());
    const TimePoint begin = Clock::now();
    const HapticReport& report = *sub.close_cycle(0);
    shared.describe.add(to_seconds(Clock::now() - begin));
    const std::vector<std::uint8_t> bytes = [&] {
      const auto encoded = codec.encode(report);
      return std::vector<std::uint8_t>(encoded.begin(), encoded.end());
    }();
    shared.answered = cycle;
    bare.receive();
    bare.send(bytes);
    await([&] { return frames.receive(); }, [&] { bus->wait(0.01); });
    const TimePoint received = Clock::now();
    frames.decode(frame);
    const TimePoint decoded = Clock::now();
    sub.synchronise_with(frame);
    const TimePoint applied = Clock::now();
    reports.write(report);
    const TimePoint sent = Clock::now();
    shared.decode.add(to_seconds(decoded - received));
    shared.apply.add(to_seconds(applied - decoded));
    shared.send.add(to_seconds(sent - applied));
    // On a machine with few cores, busy waiting would take the core of the thread that delivers the report.
    await([&] { return shared.received == cycle; }, short_sleep);
  }
  reports.wait_for_acknowledgments(1.0);
}

void ask(const Scene& scene, const BusConfig& config, int cycles, Shared& shared) {
  World world(scene);
  world.settle([](double) { return true; });
  const std::unique_ptr<Bus> bus = open_bus(config);
  Writer<WorldFrame> frames = bus->writer<WorldFrame>();
  Reader<HapticReport> reports = bus->reader<HapticReport>();
  Bare bare(config, true);
  Codec<WorldFrame> codec;
  HapticReport report;
  reserve(report, kUsualMembers);
  Histogram bare_s, round_trip_s;
  double members = 0.0, frame_bytes = 0.0;
  await([&] { return bare.matched() && frames.matched() > 0 && reports.matched() > 0 && shared.answered == 0; },
        [&] { bus->wait(0.01); });
  frames.write(world.frame(0));
  receive(*bus, reports, report);
  world.receive(std::move(report));
  for (int cycle = 1; cycle <= cycles; ++cycle) {
    // It already sleeps when the message arrives, like a loop that waits for its next step.
    await([&] { return shared.answered == cycle; }, short_sleep);
    std::this_thread::sleep_for(std::chrono::microseconds(200));
    const auto bytes = codec.encode(world.frame(0));
    const TimePoint begin = Clock::now();
    bare.send(bytes);
    bare.receive();
    bare_s.add(to_seconds(Clock::now() - begin));
    std::this_thread::sleep_for(std::chrono::microseconds(200));
    const TimePoint asked = Clock::now();
    frames.write(world.frame(0));
    receive(*bus, reports, report);
    round_trip_s.add(to_seconds(Clock::now() - asked));
    shared.received = cycle;
    members += static_cast<double>(world.frame(0).members.size());
    frame_bytes += static_cast<double>(bytes.size());
    world.receive(std::move(report));
    world.step();
  }
  const auto us = [](const Histogram& times) { return 1e6 * times.quantile_s(0.5); };
  fmt::print("{},{:.1f},{:.0f},{:.0f},{:.0f},{:.0f},{:.0f},{:.0f},{:.2f},{:.1f},{:.1f},{:.1f},{:.1f}\n",
             name_of(config.vendor), members / cycles, frame_bytes / cycles,
             static_cast<double>(reports.received_bytes()) / (cycles + 1), us(bare_s), 1e6 * bare_s.quantile_s(0.99),
             us(round_trip_s), 1e6 * round_trip_s.quantile_s(0.99), us(round_trip_s) / us(bare_s), us(shared.decode),
             us(shared.apply), us(shared.describe), us(shared.send));
}

int run(Scene scene, BusConfig config, int cycles) {
  void* const memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw Error(ExitCode::failed, "no shared memory");
  Shared& shared = *new (memory) Shared;
  const pid_t child = fork();
  if (child < 0) throw Error(ExitCode::failed, "no second process");
  const auto guarded = [&](auto side) {
    try {
      side(scene, config, cycles, shared);
      return 0;
    } catch (const std::exception& e) {
      fmt::print(stderr, "bench_round_trip: error: {}\n", e.what());
      return 1;
    }
  };
  if (child == 0) {
    const int code = guarded(answer);
    std::fflush(nullptr);
    _exit(code);
  }
  const int code = guarded(ask);
  int status = 0;
  waitpid(child, &status, 0);
  return code != 0 || !WIFEXITED(status) ? 1 : WEXITSTATUS(status);
}

int main_of(int argc, char** argv) {
  CommandLine line(
      "bench_round_trip",
      "Measures the round trip of a frame of the world and its report, beside a bare exchange of as many "
      "bytes, in turn. The columns decode, apply, describe and send are the stages of the sub-world from a "
      "frame to its report, p50 in us.");
  std::string scene_name = "heap";
  std::vector<std::string> vendors{"fastdds", "cyclonedds"};
  double box_m = 0.0;
  int cycles = 1000, domain = 97;
  line.add("scene", &scene_name, "name in deploy/scenes, or a file");
  line.add("--dds", &vendors, "DDS vendors").one_of({"fastdds", "cyclonedds"});
  line.add("--box", &box_m, "half side of the box that chooses members").range(0.0, 1e3, "m").otherwise("the scene's");
  line.add("--cycles", &cycles, "cycles of the world").range(1, 1'000'000);
  line.add("--domain", &domain, "DDS domain").range(0, 232);
  if (const auto code = line.parse(argc, argv)) return *code;
  Scene scene = load_scene(
      scene_name.find('/') == std::string::npos ? std::string(SCENES_FOLDER) + "/" + scene_name + ".yaml" : scene_name);
  scene.settings.mode = Mode::realtime;
  scene.settings.scheme = "reduced";
  keep_users(scene, 1);
  if (box_m > 0.0) scene.users[0].box_half_m = box_m;
  fmt::print(
      "vendor,members,frame_bytes,report_bytes,bare_p50_us,bare_p99_us,round_trip_p50_us,round_trip_p99_us,"
      "ratio_p50,decode_us,apply_us,describe_us,send_us\n");
  std::fflush(stdout);
  for (const std::string& vendor : vendors) {
    BusConfig config;
    config.vendor = parse_vendor(vendor);
    config.domain = domain;
    config.mode = Mode::realtime;
    config.cycle_s = 10.0;  // no deadline is of interest here
    if (const int code = run(scene, config, cycles); code != 0) return code;
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::guarded("bench_round_trip", [&] { return main_of(argc, argv); });
}
