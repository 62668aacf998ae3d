// Delayed and lost messages: a device must not deliver energy that its operator did not put in.

#include "lab/session/operator_bed.hpp"
#include "lab/stability/cases/cases.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr const char* kSchemes[] = {"direct", "paper", "reduced"};
constexpr DeviceKind kDevices[] = {DeviceKind::impedance, DeviceKind::admittance};
constexpr Side kLateSides[] = {Side::device, Side::world};

const std::vector<double> kDelays_ms{200.0, 0.0, 20.0, 100.0};

struct Ends {
  double created_j = 0.0;  ///< energy delivered to the operator beyond what the coupling could store
  double force_n = 0.0;    ///< RMS of the force on the operator
};

Ends whole_run(Scene scene, Side side, double delay_ms) {
  lengthen(scene, side, 1e-3 * delay_ms);
  CoupledRun run(scene);
  run_while(run, scene.settings.duration_s, [] { return true; });
  double squares_n2 = 0.0;
  for (const Vec3& force : run.felt[0].force) squares_n2 += force.squaredNorm();
  return {.created_j = -run.guards[0]->port().least_j(),
          .force_n = std::sqrt(squares_n2 / static_cast<double>(run.felt[0].force.size()))};
}

/// The largest value over the schemes and both links with delay.
Measurement most_energy(const Scene& scene, double delay_ms) {
  double most_j = 0.0;
  for (const char* scheme : kSchemes) {
    for (const Side side : kLateSides) {
      Scene one = scene;
      one.settings.scheme = scheme;
      most_j = std::max(most_j, whole_run(one, side, delay_ms).created_j);
    }
  }
  return {1e3 * most_j};
}

Measurement free_force(DeviceKind kind, const char* scheme, Side side, double delay_ms) {
  Scene scene = free_scene(kind);
  scene.settings.scheme = scheme;
  return {whole_run(scene, side, delay_ms).force_n};
}

/// The largest speed at which an admittance device moves an operator in free space, over all schemes and ratios.
Measurement fastest_operator(double delay_ms) {
  double fastest_m_s = 0.0;
  for (const char* scheme : kSchemes) {
    for (const int ratio : {1, 4, 20}) {
      Scene scene = free_scene(DeviceKind::admittance);
      scene.settings.scheme = scheme;
      scene.settings.set_ratio({ratio, ratio});
      lengthen(scene, Side::world, 1e-3 * delay_ms, 0.0, 0.0);
      CoupledRun run(scene);
      run_while(run, scene.settings.duration_s, [&] {
        fastest_m_s = std::max(fastest_m_s, run.devices[0]->state().linear_velocity.norm());
        return true;
      });
    }
  }
  return {fastest_m_s};
}

}  // namespace

std::vector<StabilityCase> delay_cases() {
  const char* const delay = "delay, there and back";
  const char* const passivity =
      "Passivity: int f v dt >= 0 at the operator (Colgate and Schenkel 1997, Passivity of a "
      "class of sampled-data systems)";
  const auto energy_case = [&](const char* name, const char* shows, Scene (*scene)(DeviceKind)) {
    return StabilityCase{
        .name = name,
        .shows = shows,
        .parameter = delay,
        .parameter_unit = "ms",
        .values = kDelays_ms,
        .quantity = "largest energy delivered beyond the energy received",
        .unit = "mJ",
        .formula = "0: a device delivers no energy to the operator that it has not received from the operator",
        .source = passivity,
        .compare = Compare::absolute,
        .tolerance = 1.0,
        .why = "1 mJ lifts 10 g by 1 cm: less than the energy of an operator's tremor",
        .measure =
            [scene](const EngineSetting&, double ms) {
              return Measurement{std::max(most_energy(scene(DeviceKind::impedance), ms).measured,
                                          most_energy(scene(DeviceKind::admittance), ms).measured)};
            },
        .once = true};
  };
  const auto force_case = [&](const char* name, const char* shows, DeviceKind kind, const char* scheme, Side side) {
    return StabilityCase{
        .name = name,
        .shows = shows,
        .parameter = delay,
        .parameter_unit = "ms",
        .values = kDelays_ms,
        .quantity = "force, RMS",
        .unit = "N",
        .formula = "0: there is no resistance in free space",
        .source = "Transparency (Lawrence 1993, Stability and transparency in bilateral teleoperation)",
        .compare = Compare::absolute,
        .tolerance = 0.5,
        .why = "the friction of a desktop device",
        .measure = [=](const EngineSetting&, double ms) { return free_force(kind, scheme, side, ms); },
        .once = true};
  };
  return {
      energy_case(
          "energy_free",
          "Motion in free space, with impedance and admittance devices, every scheme, delay at the device or at the "
          "world, jitter of up to 20 ms, and 5 % of the messages lost; the worst of all combinations.",
          free_scene),
      energy_case("energy_press", "The same while the operator presses a cube against a wall.",
                  [](DeviceKind kind) { return scene_with_operator("press", kind); }),
      energy_case("energy_row", "The same while the operator pushes a row of ten cubes.",
                  [](DeviceKind kind) { return scene_with_operator("row", kind); }),
      force_case("force_free", "The felt force in free space, with scheme reduced and delay at the device.",
                 DeviceKind::impedance, "reduced", Side::device),
      force_case("force_free_paper", "The same with scheme paper and delay at the world.", DeviceKind::impedance,
                 "paper", Side::world),
      force_case("force_free_direct",
                 "The same with scheme direct: only the world simulates the tool, so a delay at the world drags it.",
                 DeviceKind::impedance, "direct", Side::world),
      force_case("force_free_admittance", "The same with an admittance device, scheme reduced and delay at the world.",
                 DeviceKind::admittance, "reduced", Side::world),
      {.name = "speed_free",
       .shows =
           "The largest speed at which an admittance device moves an operator in free space, with every scheme and "
           "ratios of 1, 4 and 20.",
       .parameter = delay,
       .parameter_unit = "ms",
       .values = {5.0, 0.0, 100.0},
       .quantity = "speed",
       .unit = "m/s",
       .formula = "at most 0.5: the speed limit 0.4 m/s and a fourth more while it changes",
       .source = "The limit in device_sim/README.md (Safety)",
       .compare = Compare::at_most,
       .tolerance = 1.0,
       .why = "the limit itself",
       .expected = [](double) { return 0.5; },
       .measure = [](const EngineSetting&, double ms) { return fastest_operator(ms); },
       .once = true},
  };
}

}  // namespace subworld
