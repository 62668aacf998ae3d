#include "import/world.hpp"
#include "model/error.hpp"
#include "model/scene/mesh_file.hpp"
#include "model/scene/movable_mesh.hpp"
#include "model/shapes/convex_parts.hpp"
#include "model/shapes/mass_properties.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

namespace subworld::import {

namespace {

namespace fs = std::filesystem;

constexpr double kDegrees = 180.0 / M_PI;
constexpr double kTiny_m = 1e-3;  ///< radius of what stands for a link without shapes
constexpr double kTiny_kg = 1e-3;
constexpr double kFarBelow_m = -1000.0;  ///< of the body that stands for the world

std::string number(double x) { return fmt::format("{:.12g}", x == 0.0 ? 0.0 : x); }
std::string list(const Vec3& v) { return fmt::format("[{}, {}, {}]", number(v.x()), number(v.y()), number(v.z())); }

std::string turn(const Quat& q) {
  const Eigen::AngleAxisd turn(q);
  if (std::abs(turn.angle()) < 1e-9) return "";
  return fmt::format(", rotation: {{axis: {}, angle_deg: {}}}", list(turn.axis()), number(kDegrees * turn.angle()));
}

class Writer {
 public:
  Writer(World& world, const fs::path& to) : world_(world), folder_(to.parent_path()) {}

  std::string text() {
    for (const Link& link : world_.links) links_.emplace(link.name, &link);
    std::string bodies, joints;
    for (const Link& link : world_.links) bodies += link.fixed ? fixed(link) : movable(link);
    for (const LinkJoint& joint : world_.joints) joints += joint_text(joint);
    if (anchored_)
      bodies += fmt::format(
          "  - {{name: world, shape: sphere, radius_m: {}, fixed: true, position_m: [0, 0, {}]}}  "
          "# holds the joints to the world\n",
          kTiny_m, kFarBelow_m);
    return fmt::format("name: {}\nsettings:\n  duration_s: 5\n  gravity_m_s2: {}\n{}bodies:\n{}{}{}{}",
                       plain(world_.name), list(world_.gravity), materials(), bodies, joints.empty() ? "" : "joints:\n",
                       joints, user());
  }

 private:
  /// A name as scenes have it.
  static std::string plain(std::string name) {
    for (char& c : name) {
      if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-' && c != '.') c = '_';
    }
    return name.empty() ? "unnamed" : name;
  }
  std::string unique(const std::string& name) {
    std::string free = plain(name);
    for (int i = 2; !names_.insert(free).second; ++i) free = fmt::format("{}_{}", plain(name), i);
    return free;
  }
  std::string body_name(const std::string& link) {
    const auto [at, is_new] = body_names_.try_emplace(link);
    if (is_new) at->second = unique(link);
    return at->second;
  }

  std::string material(const Geometry& shape) {
    const auto [at, is_new] = materials_.try_emplace(shape.surface);
    if (is_new) at->second = fmt::format("material_{}", materials_.size());
    return fmt::format(", material: {}", at->second);
  }

  /// Spinning and rolling friction of a contact, m.
  static std::array<double, 2> turning(const Surface& a, const Surface& b) {
    const int directions = std::max(a.directions, b.directions);
    return {directions < 4 ? 0.0 : std::max(a.spinning_friction, b.spinning_friction),
            directions < 6 ? 0.0 : std::max(a.rolling_friction, b.rolling_friction)};
  }
  /// A scene adds the frictions against turning of both. Where that is not the contact's, a pair says so.
  std::string materials() const {
    std::string text, pairs;
    const auto turning_text = [](const std::array<double, 2>& friction) {
      return fmt::format(", spinning_friction_m: {}, rolling_friction_m: {}", number(friction[0]), number(friction[1]));
    };
    for (auto a = materials_.begin(); a != materials_.end(); ++a) {
      const auto own = turning(a->first, a->first);
      text += fmt::format("  {}: {{friction: {}, restitution: {}{}}}\n", a->second, number(a->first.friction),
                          number(a->first.restitution), own == std::array{0.0, 0.0} ? "" : turning_text(own));
      for (auto b = materials_.begin(); b != std::next(a); ++b) {
        const auto both = turning(a->first, b->first), other = turning(b->first, b->first);
        if (both != std::array{own[0] + other[0], own[1] + other[1]})
          pairs += fmt::format("  - {{a: {}, b: {}{}}}\n", b->second, a->second, turning_text(both));
      }
    }
    return (text.empty() ? "" : "materials:\n" + text) + (pairs.empty() ? "" : "pairs:\n" + pairs);
  }

  /// Files of one name in different folders get different names.
  std::string copied(const Geometry& shape) {
    const auto [known, is_new] = meshes_.try_emplace(fs::weakly_canonical(shape.file));
    if (!is_new) return known->second;
    fs::path name = shape.file.filename();
    for (int i = 2; !mesh_names_.insert(name.string()).second; ++i)
      name = fmt::format("{}_{}{}", shape.file.stem().string(), i, shape.file.extension().string());
    const fs::path to = folder_ / "meshes" / name;
    std::error_code error;
    fs::create_directories(to.parent_path(), error);
    if (!fs::equivalent(shape.file, to, error)) fs::copy_file(shape.file, to, fs::copy_options::overwrite_existing);
    return known->second = "meshes/" + name.string();
  }

  /// Shape and measures. `as`: how a mesh collides.
  std::string measures(const Geometry& shape, const char* as) {
    switch (shape.kind) {
      case Geometry::Kind::box:
        return fmt::format("shape: box, size_m: {}", list(shape.size));
      case Geometry::Kind::sphere:
        return fmt::format("shape: sphere, radius_m: {}", number(shape.radius));
      case Geometry::Kind::cylinder:
      case Geometry::Kind::capsule:
        return fmt::format("shape: {}, radius_m: {}, length_m: {}",
                           shape.kind == Geometry::Kind::cylinder ? "cylinder" : "capsule", number(shape.radius),
                           number(shape.length));
      case Geometry::Kind::plane:
        return "shape: plane";
      case Geometry::Kind::mesh:
        return fmt::format("shape: {}, file: {}, scale: {}", as, copied(shape), number(shape.scale));
    }
    return "";
  }

  void grow(const Pose& pose, double reach) {
    box_.extend({pose.position - Vec3::Constant(reach), pose.position + Vec3::Constant(reach)});
  }
  static double reach_of(const Geometry& shape) {
    return shape.kind == Geometry::Kind::box ? 0.5 * shape.size.norm() : shape.radius + 0.5 * shape.length;
  }

  std::string fixed(const Link& link) {
    std::string text;
    for (const Geometry& shape : link.shapes) {
      const Pose pose = link.pose * shape.pose;
      const std::string name = link.shapes.size() == 1 ? body_name(link.name) : unique(link.name + "." + shape.name);
      body_names_.try_emplace(link.name, name);
      if (shape.kind != Geometry::Kind::plane && shape.kind != Geometry::Kind::mesh) grow(pose, reach_of(shape));
      text += fmt::format("  - {{name: {}, {}, fixed: true, position_m: {}{}{}}}\n", name, measures(shape, "mesh"),
                          list(pose.position), turn(pose.orientation), material(shape));
    }
    return text;
  }

  /// Concavity with which a scene divides the mesh of a link that moves, m; 0: its hull collides.
  double concavity_m(const Link& link, const Geometry& shape) {
    if (shape.kind != Geometry::Kind::mesh || shape.is_hull) return 0.0;
    const auto hull_because = [&](const std::string& why) {
      world_.remark(0, fmt::format("collision {}.{}: {}, so the convex hull collides", link.name, shape.name, why));
      return 0.0;
    };
    try {
      Mesh mesh = read_mesh(shape.file.string(), shape.scale, false);
      if (const auto fault = turn_outwards(mesh))
        return hull_because(fmt::format("the mesh {} ({})", fault->first, fault->second));
      const double noticeable_m = usual_concavity_m(mesh);
      if (convex_parts(mesh, noticeable_m, 1).error_m <= noticeable_m) return 0.0;
      if (link.shapes.size() > 1) return hull_because("a concave mesh is not divided beside other shapes of its link");
      return noticeable_m;
    } catch (const std::runtime_error& e) {
      throw Error(ExitCode::usage, fmt::format("{}: {}", shape.file.string(), e.what()));
    }
  }

  std::string movable(const Link& link) {
    std::string shape_text = "    shape: compound\n", parts, body_material;
    Pose frame;  // in the link: of what the body's position and rotation place
    const auto add = [&](const std::string& shape, const Pose& pose, const std::string& with) {
      parts +=
          fmt::format("      - {{{}, position_m: {}{}{}}}\n", shape, list(pose.position), turn(pose.orientation), with);
    };
    std::optional<std::array<double, 2>> resistance;
    for (const Geometry& shape : link.shapes) {
      if (shape.kind == Geometry::Kind::plane) {
        world_.remark(0, fmt::format("collision {}.{}: a plane that moves is omitted", link.name, shape.name));
        continue;
      }
      if (!resistance) body_material = material(shape);
      const auto own = turning(shape.surface, shape.surface);
      if (resistance.value_or(own) != own)
        world_.remark(0, fmt::format("collision {}.{}: has the rolling and spinning friction of the link's first shape",
                                     link.name, shape.name));
      resistance = resistance.value_or(own);
      grow(link.pose * shape.pose, reach_of(shape));
      if (const double concavity = concavity_m(link, shape); concavity > 0.0) {
        frame = shape.pose;
        shape_text = fmt::format(
            "    shape: mesh\n    file: {}\n    scale: {}\n    decompose: {{concavity_m: {:.3g}, most_parts: 64}}\n",
            copied(shape), number(shape.scale), concavity);
      } else {
        add(measures(shape, "convex"), shape.pose, material(shape));
      }
    }
    if (!resistance) {
      add(fmt::format("shape: sphere, radius_m: {}", kTiny_m), {link.centre, Quat::Identity()}, "");
      world_.remark(0, fmt::format("link {}: has no collision shape; a sphere of 1 mm stands for it", link.name));
      grow(link.pose, kTiny_m);
    }
    return fmt::format("  - name: {}\n{}{}{}", body_name(link.name), shape_text, mechanics(link, frame, body_material),
                       parts.empty() ? "" : "    parts:\n" + parts);
  }

  /// What a body has besides its shape.
  std::string mechanics(const Link& link, const Pose& frame, const std::string& of_material) {
    double mass = link.mass;
    Eigen::Matrix3d i = link.inertia;
    if (!(mass > 0.0) || !of_a_body(principal_axes(i).moments)) {
      world_.remark(0, fmt::format("link {}: its mass or inertia is that of no body; it gets 1 g", link.name));
      mass = kTiny_kg;
      i = 0.4 * mass * kTiny_m * Eigen::Matrix3d::Identity();
    }
    const Eigen::Matrix3d axes = frame.orientation.toRotationMatrix();
    i = axes.transpose() * i * axes;
    const Pose placed = link.pose * frame;
    const auto line = [](const std::string& flow) { return flow.empty() ? "" : "    " + flow.substr(2) + "\n"; };
    return fmt::format(
        "    position_m: {}\n{}{}    mass_kg: {}\n    centre_of_mass_m: {}\n"
        "    inertia_kg_m2: [{}, {}, {}, {}, {}, {}]\n{}{}",
        list(placed.position), line(turn(placed.orientation)), line(of_material), number(mass),
        list(axes.transpose() * (link.centre - frame.position)), number(i(0, 0)), number(i(1, 1)), number(i(2, 2)),
        number(i(0, 1)), number(i(0, 2)), number(i(1, 2)), link.gravity ? "" : "    gravity: false\n",
        link.group.empty() ? "" : fmt::format("    collision_group: {}\n", plain(link.group)));
  }

  static std::string axis_text(const JointAxis& axis, bool turns) {
    std::string text;
    const auto add = [&](const char* key, const std::string& value) {
      text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", key, value);
    };
    const double unit = turns ? kDegrees : 1.0, most = turns ? 180.0 : 1e6;
    const auto limit = [&](double x) { return number(std::clamp(unit * x, -most, most)); };
    if (std::isfinite(axis.lower) || std::isfinite(axis.upper))
      add(turns ? "limits_deg" : "limits_m", fmt::format("[{}, {}]", limit(axis.lower), limit(axis.upper)));
    if (axis.friction > 0.0) add(turns ? "friction_n_m" : "friction_n", number(axis.friction));
    if (axis.damping > 0.0) add(turns ? "damping_n_m_s" : "damping_n_s_m", number(axis.damping));
    if (axis.stiffness > 0.0) add(turns ? "stiffness_n_m_rad" : "stiffness_n_m", number(axis.stiffness));
    if (axis.stiffness > 0.0 && axis.rest != 0.0) add(turns ? "rest_deg" : "rest_m", limit(axis.rest));
    return "{" + text + "}";
  }

  std::string joint_text(LinkJoint joint) {
    for (const std::string& link : {joint.a, joint.b}) {
      if (link.empty() || links_.contains(link)) continue;
      world_.remark(0, fmt::format("joint {}: omitted, because there is no link {}", joint.name, link));
      return "";
    }
    for (std::size_t i = 3; i < joint.axes.size(); ++i) {
      JointAxis& axis = joint.axes[i];
      const bool within = axis.lower >= -M_PI && axis.upper <= M_PI;
      const bool unlimited = std::isinf(axis.lower) && std::isinf(axis.upper);
      if (!axis.free || within || unlimited) continue;
      axis.lower = -INFINITY, axis.upper = INFINITY;
      world_.remark(0, fmt::format("joint {}: limits beyond 180 degrees are omitted", joint.name));
    }
    const auto is_fixed = [&](const std::string& link) { return link.empty() || links_.at(link)->fixed; };
    if (is_fixed(joint.a) && is_fixed(joint.b)) return "";
    const auto name_of_body = [&](const std::string& link) -> std::string {
      if (!link.empty() && (!links_.at(link)->fixed || !links_.at(link)->shapes.empty())) return body_name(link);
      anchored_ = true;
      return "world";
    };
    std::string text = fmt::format("  - {{name: {}, type: {}, bodies: [{}, {}], at_m: {}", plain(joint.name),
                                   subworld::name_of(joint.kind), name_of_body(joint.a), name_of_body(joint.b),
                                   list(joint.frame.position));
    const Quat& frame = joint.frame.orientation;
    const auto free = [&](const char* key, int axis) {
      text += fmt::format(", {}: {}", key, axis_text(joint.axes[static_cast<std::size_t>(axis)], axis >= 3));
    };
    switch (joint.kind) {
      case JointKind::hinge:
      case JointKind::slider:
        text += fmt::format(", axis: {}", list(frame * Vec3::UnitZ()));
        joint.kind == JointKind::hinge ? free("turn", 5) : free("slide", 2);
        break;
      case JointKind::ball:
        free("turns", 3);
        break;
      case JointKind::universal:
        text += fmt::format(", axis: {}, second_axis: {}", list(frame * Vec3::UnitX()), list(frame * Vec3::UnitY()));
        free("turn", 3);
        free("second_turn", 4);
        break;
      case JointKind::six: {
        text += turn(frame);
        constexpr std::array kKeys{"x", "y", "z", "turn_x", "turn_y", "turn_z"};
        for (int i = 0; i < 6; ++i) {
          if (joint.axes[static_cast<std::size_t>(i)].free) free(kKeys[static_cast<std::size_t>(i)], i);
        }
        break;
      }
      default:
        break;
    }
    return text + "}\n";
  }

  /// A sphere in front of everything, at half its height.
  std::string user() const {
    const Box around = box_.lower.x() > box_.upper.x() ? Box{} : box_;
    const Vec3 size = around.upper - around.lower;
    const double extent = std::max(size.maxCoeff(), 0.01), radius = std::clamp(0.05 * extent, 0.002, 0.03);
    const Vec3 middle = 0.5 * (around.lower + around.upper);
    const Vec3 at(around.lower.x() - 2.0 * radius, middle.y(), std::max(middle.z(), radius));
    return fmt::format(
        "users:\n  - name: user\n    proxy: {{shape: sphere, radius_m: {}, mass_kg: 0.1, position_m: {}, "
        "rotates: false, gravity: false}}\n    box_half_m: {}\n",
        number(radius), list(at), number(std::max(0.2, 8.0 * radius)));
  }

  World& world_;
  fs::path folder_;
  std::map<std::string, const Link*> links_;
  std::map<std::string, std::string> body_names_;
  std::map<fs::path, std::string> meshes_;
  std::set<std::string> mesh_names_;
  std::set<std::string> names_{"world"};
  std::map<Surface, std::string> materials_;
  Box box_{Vec3::Constant(1e9), Vec3::Constant(-1e9)};
  bool anchored_ = false;
};

}  // namespace

void write_scene(World& world, const std::filesystem::path& to) {
  const std::string text = Writer(world, fs::absolute(to)).text();
  std::ofstream out(to);
  out << text;
  if (!out.flush()) throw Error(ExitCode::failed, fmt::format("{}: cannot be written", to.string()));
}

}  // namespace subworld::import
