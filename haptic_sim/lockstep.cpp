#include "haptic_sim/engine_orders.hpp"
#include "haptic_sim/lockstep_order.hpp"
#include "haptic_sim/run.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"

namespace subworld {

namespace {

constexpr double kReportAcknowledged_s = 1.0;  ///< that the last report may take to arrive

/// The haptic process in lock-step.
class LockstepLoop {
 public:
  LockstepLoop(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
               const Scene& scene)
      : ports_(ports),
        sub_(sub),
        measures_(measures),
        stages_(measures.stages()),
        orders_(ports, sub, measures, exchange),
        order_(scene, sub),
        device_sim_{ProgramKind::device_sim, static_cast<std::uint32_t>(sub.user())} {
    reserve(frame_, kUsualMembers);
  }

  Ending run() {
    Ending ending{.session = ports_.session, .from_s = sub_.time_s(), .by = "last frame"};
    stages_.begin();
    if (sub_.reports_at_start()) send_report();
    while (order_.take_frames(sub_, [this](std::uint64_t) { return take_frame(); }) && take_device()) step();
    ending.to_s = sub_.time_s();
    if (last_) {
      send_last_command(ports_, device_, 1);
      ports_.reports.wait_for_acknowledgments(kReportAcknowledged_s);
    } else {
      ending.by = name_of_signal(stop_signal());
    }
    return ending;
  }

 private:
  static bool stopped() { return stop_signal() != 0; }

  /// False after the last frame, or when asked to stop.
  bool take_frame() {
    const auto ours = [this](const WorldFrame& came) { return came.session == ports_.session; };
    if (!await(*ports_.bus, ports_.status, ports_.frames, frame_, stages_, kWorldSim, ours, stopped)) return false;
    if (ports_.refused_by(frame_)) throw Error(ExitCode::failed, refused_text(static_cast<std::uint32_t>(sub_.user())));
    const TimePoint begin = stages_.now();
    measures_.answered(frame_.echoed_sent_ns, begin);
    last_ = frame_.last;
    const std::uint64_t lost = sub_.synchronise_with(frame_);
    measures_.synchronised(to_seconds(stages_.mark(HapticStage::synchronise) - begin), lost);
    return !last_;
  }

  bool take_device() {
    const auto ours = [this](const DeviceState& came) {
      return came.session == ports_.session && (device_writer_ == 0 || came.sender == device_writer_);
    };
    if (!await(*ports_.bus, ports_.status, ports_.device, device_, stages_, device_sim_, ours, stopped)) return false;
    device_writer_ = device_.sender;
    ports_.device.trust_sender();
    return true;
  }

  void step() {
    orders_.follow();
    const TimePoint begin = stages_.mark(HapticStage::control);
    const auto send = [this](const DeviceCommand& command, const FeltStep&) {
      stages_.mark(HapticStage::feel);
      if (!ports_.command.write(command))
        throw Error(ExitCode::failed, unsent_text("device_command", ports_.device, ports_.status, device_sim_));
      stages_.mark(HapticStage::send);
    };
    const FeltStep felt = order_.step(sub_, device_, send, [this] {
      stages_.mark(HapticStage::advance);
      send_report();
    });
    measures_.step(sub_, felt, {to_seconds(stages_.mark(HapticStage::advance) - begin)});
    if (!sub_.finite())
      throw Error(ExitCode::failed, "the sub-world is no longer finite; use a smaller h_s or the preset quality");
    ports_.status.update(measures_.state(sub_.time_s()));
    stages_.mark(HapticStage::account);
    measures_.end_step();
  }

  void send_report() {
    HapticReport* const report = sub_.close_cycle(to_ns(Clock::now()));
    if (report != nullptr && !ports_.send(*report))
      throw Error(ExitCode::failed, unsent_text("haptic_report", ports_.frames, ports_.status, kWorldSim));
    stages_.mark(HapticStage::report);
  }

  static constexpr Peer kWorldSim{ProgramKind::world_sim, 0};

  HapticPorts& ports_;
  SubWorld& sub_;
  HapticMeasures& measures_;
  Stages<HapticStage>& stages_;
  EngineOrders orders_;
  LockstepOrder order_;
  Peer device_sim_;
  DeviceState device_;
  WorldFrame frame_;
  std::uint64_t device_writer_ = 0;  ///< the process that sent the first state
  bool last_ = false;
};

}  // namespace

Ending run_lockstep(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                    const Scene& scene) {
  return LockstepLoop(ports, sub, measures, exchange, scene).run();
}

}  // namespace subworld
