#pragma once

#include <array>
#include <string>
#include <string_view>

namespace subworld {

/// A command of `subworld` that is a program of its own, built when it is first used.
struct Tool {
  const char* name;
  const char* about;
};

/// The program of a tool is subworld_NAME.
inline constexpr std::array kTools{
    Tool{"device", "Lists the drivers of haptic devices, or examines one"},
    Tool{"doctor", "Examines this machine, its network and a running domain; names faults with their cures"},
    Tool{"film", "Makes pictures, and a video, of a recording: any moment, camera and speed"},
    Tool{"import", "Makes a scene of a world in SDFormat, a robot in URDF or a model in MJCF"},
    Tool{"keys", "Makes and checks keys, by which the programs of a run prove their roles (DDS Security)"},
    Tool{"link", "Emulates a network between hosts on this machine: delay, jitter, loss, rate, outage"},
    Tool{"recorder", "Records the programs of one host of a session, for `subworld up --record`"},
    Tool{"replay", "Shows what a recording holds, publishes it, and re-simulates it"},
    Tool{"report", "Writes one page on a run, a session or a lab from its folder: figures, verdict, plots"},
    Tool{"ros2", "Shows a run to ROS 2: forces, poses, tf, markers, clock; and takes devices from it"},
    Tool{"study", "Conducts a study: conditions, trials, staircases, questions, and one table"},
    Tool{"top", "Shows the domains in use, their programs, rates and missed deadlines"}};

/// The program of a lab is lab_NAME.
inline constexpr std::array kLabs{
    Tool{"coupling", "The error of the felt force against the run time of each coupling scheme"},
    Tool{"engines", "The cost of a step of each physics engine, and whether structures stand"},
    Tool{"stability", "The distance of each engine from formulas and limits of mechanics, with margins"},
    Tool{"plan", "The time that each optimisation saves, and the difference that it makes"},
    Tool{"latency", "The largest delay that a user does not feel"},
    Tool{"network", "The loss, delay and gaps of messages over a network, for each vendor and service"}};

[[nodiscard]] bool is_tool(std::string_view name);
[[nodiscard]] const char* about_tool(std::string_view name);
[[nodiscard]] bool is_lab(std::string_view name);

/// Becomes another program of the build. `arguments` end with a null, the first is the program's own name. Throws
/// `Error` (failed) where it cannot start.
[[noreturn]] void become(const std::string& name, char** arguments);

/// First line that a command of the shell prints; empty where it prints none.
[[nodiscard]] std::string first_line_of(const std::string& command);

}  // namespace subworld
