#include "import/sdf_faults.hpp"
#include "import/world.hpp"
#include "model/error.hpp"
#include "model/trigonometry.hpp"

#include <fmt/core.h>
#include <sdf/sdf.hh>

#include <cstdlib>
#include <fstream>
#include <set>
#include <utility>

namespace subworld::import {

namespace {

namespace fs = std::filesystem;
using ignition::math::Pose3d;
using ignition::math::Vector3d;

Vec3 vec(const Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }
Pose pose_of(const Pose3d& p) {
  return {vec(p.Pos()), Quat(p.Rot().W(), p.Rot().X(), p.Rot().Y(), p.Rot().Z()).normalized()};
}
int line_of(const sdf::ElementPtr& element) { return element ? element->LineNumber().value_or(0) : 0; }

/// Elements that a scene has nothing for.
const std::set<std::string>& omitted() {
  static const std::set<std::string> names{
      "plugin",         "sensor",           "light",   "actor",     "gui",        "wind",
      "magnetic_field", "particle_emitter", "gripper", "projector", "audio_sink", "audio_source",
      "population",     "battery",          "road",    "state",     "atmosphere", "transmission"};
  return names;
}

class SdfReader {
 public:
  explicit SdfReader(const fs::path& file) : file_(file) {
    sdf::ParserConfig settings;
    settings.SetFindCallback([this](const std::string& uri) { return model_at(uri); });
    load(root_, file, settings);
  }

  World read() {
    if (root_.WorldCount() > 1)
      world_.remark(0, fmt::format("{} worlds: only the first one is read", root_.WorldCount()));
    if (root_.WorldCount() > 0) {
      const sdf::World& world = *root_.WorldByIndex(0);
      world_.name = world.Name();
      world_.gravity = vec(world.Gravity());
      for (std::uint64_t i = 0; i < world.ModelCount(); ++i) read_model(*world.ModelByIndex(i), Pose{}, "");
      list_omitted(world.Element());
    } else if (const sdf::Model* model = root_.Model()) {
      world_.name = model->Name();
      read_model(*model, Pose{}, "");
      list_omitted(model->Element());
    } else {
      throw Error(ExitCode::usage, fmt::format("{}: holds neither a world nor a model", file_.string()));
    }
    if (visuals_ > 0) world_.remark(0, fmt::format("{} visuals are omitted: the collision shapes are drawn", visuals_));
    return std::move(world_);
  }

 private:
  /// The folder or file of an included model; empty: not found. Gazebo's ground and sun need not be installed.
  std::string model_at(const std::string& uri) {
    for (const auto& [name, content] :
         {std::pair("sun", "<light type='directional' name='sun'/>"),
          std::pair("ground_plane",
                    "<model name='ground_plane'><static>true</static><link name='link'><collision "
                    "name='collision'><geometry><plane/></geometry></collision></link></model>")}) {
      if (uri != fmt::format("model://{}", name)) continue;
      const fs::path file = made_.path() / fmt::format("{}.sdf", name);
      std::ofstream(file) << "<sdf version='1.7'>" << content << "</sdf>";
      return file.string();
    }
    return find(uri).string();
  }

  void list_omitted(const sdf::ElementPtr& element) {
    if (!element) return;
    for (auto child = element->GetFirstElement(); child; child = child->GetNextElement()) {
      const std::string& name = child->GetName();
      if (!child->GetExplicitlySetInFile()) continue;  // a default of the library
      if (name == "visual") {
        ++visuals_;
      } else if (omitted().contains(name)) {
        const bool named = child->HasAttribute("name") && child->GetAttribute("name")->GetSet();
        world_.remark(line_of(child), fmt::format("{}{} is omitted", name,
                                                  named ? " " + child->Get<std::string>("name") : std::string()));
      } else {
        list_omitted(child);
      }
    }
  }

  static Pose resolved(const sdf::SemanticPose& semantic) {
    Pose3d pose;
    if (const sdf::Errors errors = semantic.Resolve(pose); !errors.empty())
      throw Error(ExitCode::usage, errors.front().Message());
    return pose_of(pose);
  }

  void read_model(const sdf::Model& model, const Pose& parent, const std::string& prefix) {
    Pose3d raw;
    if (const sdf::Errors errors = model.SemanticPose().Resolve(raw); !errors.empty()) fail(file_, errors);
    const Pose frame = parent * pose_of(raw);
    const std::string inside = prefix + model.Name() + ".";
    for (std::uint64_t i = 0; i < model.LinkCount(); ++i) read_link(model, *model.LinkByIndex(i), frame, inside);
    for (std::uint64_t i = 0; i < model.ModelCount(); ++i) read_model(*model.ModelByIndex(i), frame, inside);
    for (std::uint64_t i = 0; i < model.JointCount(); ++i) read_joint(model, *model.JointByIndex(i), frame, inside);
  }

  void read_link(const sdf::Model& model, const sdf::Link& from, const Pose& frame, const std::string& inside) {
    Link link;
    link.name = inside + from.Name();
    Pose3d pose;
    if (const sdf::Errors errors = from.SemanticPose().Resolve(pose, "__model__"); !errors.empty()) fail(file_, errors);
    link.pose = frame * pose_of(pose);
    link.fixed = model.Static();
    if (!model.SelfCollide() && model.LinkCount() > 1) link.group = inside.substr(0, inside.size() - 1);
    const auto& inertial = from.Inertial();
    link.mass = inertial.MassMatrix().Mass();
    link.centre = vec(inertial.Pose().Pos());
    const auto moi = inertial.Moi();  // along the link's axes
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) link.inertia(r, c) = moi(static_cast<unsigned>(r), static_cast<unsigned>(c));
    const sdf::ElementPtr element = from.Element();
    if (element && element->HasElement("gravity")) link.gravity = element->Get<bool>("gravity");
    if (element && element->HasElement("kinematic") && element->Get<bool>("kinematic"))
      world_.remark(line_of(element), fmt::format("link {}: kinematic is omitted", link.name));
    for (std::uint64_t i = 0; i < from.CollisionCount(); ++i) read_shape(*from.CollisionByIndex(i), link);
    world_.links.push_back(std::move(link));
  }

  void read_shape(const sdf::Collision& from, Link& link) {
    Geometry shape;
    shape.name = from.Name();
    Pose3d pose;
    if (const sdf::Errors errors = from.SemanticPose().Resolve(pose); !errors.empty()) fail(file_, errors);
    shape.pose = pose_of(pose);
    const sdf::ElementPtr element = from.Element();
    const auto omit = [&](std::string_view what) {
      world_.remark(line_of(element), fmt::format("collision {}.{}: {}", link.name, shape.name, what));
    };
    read_surface(element, shape);
    const sdf::Geometry& geometry = *from.Geom();
    switch (geometry.Type()) {
      case sdf::GeometryType::BOX:
        shape.kind = Geometry::Kind::box;
        shape.size = vec(geometry.BoxShape()->Size());
        break;
      case sdf::GeometryType::SPHERE:
        shape.kind = Geometry::Kind::sphere;
        shape.radius = geometry.SphereShape()->Radius();
        break;
      case sdf::GeometryType::CYLINDER:
        shape.kind = Geometry::Kind::cylinder;
        shape.radius = geometry.CylinderShape()->Radius();
        shape.length = geometry.CylinderShape()->Length();
        break;
      case sdf::GeometryType::CAPSULE:
        shape.kind = Geometry::Kind::capsule;
        shape.radius = geometry.CapsuleShape()->Radius();
        shape.length = geometry.CapsuleShape()->Length();
        break;
      case sdf::GeometryType::PLANE:
        shape.kind = Geometry::Kind::plane;
        shape.pose.orientation = shape.pose.orientation * turn_of_z(vec(geometry.PlaneShape()->Normal()).normalized());
        break;
      case sdf::GeometryType::MESH: {
        const sdf::Mesh& mesh = *geometry.MeshShape();
        shape.kind = Geometry::Kind::mesh;
        shape.file = find(mesh.Uri());
        shape.scale = mesh.Scale().X();
        if (shape.file.empty()) return omit(fmt::format("the mesh {} is not found", mesh.Uri()));
        if (mesh.Scale() != Vector3d(shape.scale, shape.scale, shape.scale))
          omit("scales of a mesh that differ are not possible; that of x holds");
        break;
      }
      default:
        return omit("a shape of this kind is omitted");
    }
    link.shapes.push_back(std::move(shape));
  }

  static void read_surface(const sdf::ElementPtr& collision, Geometry& shape) {
    shape.surface.friction = 1.0;  // SDFormat's default
    if (!collision || !collision->HasElement("surface")) return;
    const sdf::ElementPtr surface = collision->GetElement("surface");
    if (surface->HasElement("friction") && surface->GetElement("friction")->HasElement("ode")) {
      const sdf::ElementPtr ode = surface->GetElement("friction")->GetElement("ode");
      if (ode->HasElement("mu")) shape.surface.friction = std::min(ode->Get<double>("mu"), 100.0);
    }
    if (surface->HasElement("bounce"))
      shape.surface.restitution =
          std::clamp(surface->GetElement("bounce")->Get<double>("restitution_coefficient"), 0.0, 1.0);
  }

  /// Schemes such as model:// name a folder above the file, or beside it.
  fs::path find(std::string uri) const {
    if (const std::size_t scheme = uri.find("://"); scheme != std::string::npos) uri = uri.substr(scheme + 3);
    if (fs::path(uri).is_absolute()) return fs::exists(uri) ? fs::path(uri) : fs::path();
    std::error_code error;
    fs::path folder = fs::absolute(file_).parent_path();
    for (int up = 0; up < 4; ++up, folder = folder.parent_path()) {
      if (fs::exists(folder / uri, error)) return folder / uri;
      const fs::path without = fs::path(uri).lexically_relative(*fs::path(uri).begin());  // without the package
      if (fs::exists(folder / without, error)) return folder / without;
    }
    return {};
  }

  void read_joint(const sdf::Model& model, const sdf::Joint& from, const Pose& frame, const std::string& inside) {
    LinkJoint joint;
    joint.name = inside + from.Name();
    const int line = line_of(from.Element());
    std::string child, parent;
    if (const sdf::Errors errors = from.ResolveChildLink(child); !errors.empty()) fail(file_, errors);
    if (const sdf::Errors errors = from.ResolveParentLink(parent); !errors.empty()) fail(file_, errors);
    const auto full = [&](const std::string& link) {
      std::string name = link;
      for (std::size_t at; (at = name.find("::")) != std::string::npos;) name.replace(at, 2, ".");
      return link == "world" ? std::string() : inside + name;
    };
    joint.a = full(child);
    joint.b = full(parent);
    Pose3d raw;
    if (const sdf::Errors errors = from.SemanticPose().Resolve(raw, "__model__"); !errors.empty()) fail(file_, errors);
    joint.frame = frame * pose_of(raw);
    const auto axis = [&](unsigned i) {
      Vector3d xyz;
      if (const sdf::Errors errors = from.Axis(i)->ResolveXyz(xyz, "__model__"); !errors.empty()) fail(file_, errors);
      return Vec3((frame.orientation * vec(xyz)).normalized());
    };
    const auto along = [&](JointKind kind, int free) {
      joint.kind = kind;
      joint.frame.orientation = turn_of_z(axis(0).normalized());
      joint.axes[static_cast<std::size_t>(free)] = read_axis(*from.Axis(0), line, joint.name);
    };
    switch (from.Type()) {
      case sdf::JointType::FIXED:
        break;
      case sdf::JointType::REVOLUTE:
      case sdf::JointType::CONTINUOUS:
        along(JointKind::hinge, 5);
        break;
      case sdf::JointType::PRISMATIC:
        along(JointKind::slider, 2);
        break;
      case sdf::JointType::BALL:
        joint.kind = JointKind::ball;
        for (std::size_t i = 3; i < 6; ++i) joint.axes[i].free = true;
        break;
      case sdf::JointType::UNIVERSAL:
      case sdf::JointType::REVOLUTE2:
        if (!read_universal(from, axis(0), axis(1), line, joint)) return;
        break;
      default:
        return world_.remark(line, fmt::format("joint {}: its type is omitted; the links are not joined", joint.name));
    }
    if (model.Static()) return;
    world_.joints.push_back(std::move(joint));
  }

  bool read_universal(const sdf::Joint& from, const Vec3& first, const Vec3& second, int line, LinkJoint& joint) {
    if (std::abs(first.dot(second)) > 1e-3) {
      world_.remark(line, fmt::format("joint {}: axes that are not perpendicular; omitted", joint.name));
      return false;
    }
    joint.kind = JointKind::universal;
    Eigen::Matrix3d axes;
    axes << first, first.cross(second).cross(first), first.cross(second);
    axes.colwise().normalize();
    joint.frame.orientation = Quat(axes);
    joint.axes[3] = read_axis(*from.Axis(0), line, joint.name);
    joint.axes[4] = read_axis(*from.Axis(1), line, joint.name);
    return true;
  }

  JointAxis read_axis(const sdf::JointAxis& from, int line, const std::string& joint) {
    constexpr double kUnlimited = 1e15;
    JointAxis axis{.free = true};
    if (from.Lower() > -kUnlimited) axis.lower = from.Lower();
    if (from.Upper() < kUnlimited) axis.upper = from.Upper();
    axis.friction = std::max(0.0, from.Friction());
    axis.damping = std::max(0.0, from.Damping());
    axis.stiffness = std::max(0.0, from.SpringStiffness());
    if (axis.stiffness > 0.0) axis.rest = from.SpringReference();
    if (from.Effort() > 0.0 && std::isfinite(from.Effort()) && from.Effort() < kUnlimited)
      world_.remark(line, fmt::format("joint {}: the limit of effort is omitted: no motor drives it", joint));
    return axis;
  }

  /// A folder for the time of reading.
  struct Made {
    fs::path folder;
    const fs::path& path() {
      if (folder.empty()) {
        std::string name = (fs::temp_directory_path() / "subworld_import_XXXXXX").string();
        folder = mkdtemp(name.data());
      }
      return folder;
    }
    ~Made() {
      std::error_code error;
      if (!folder.empty()) fs::remove_all(folder, error);
    }
  };

  fs::path file_;
  Made made_;
  sdf::Root root_;
  World world_;
  std::size_t visuals_ = 0;
};

}  // namespace

World read_sdf(const std::filesystem::path& file) {
  sdf::Console::Instance()->SetQuiet(true);
  return SdfReader(file).read();
}

}  // namespace subworld::import
