// `subworld import`: worlds in SDFormat, robots in URDF and models in MJCF become scenes with the same mechanics.
#include "model/scene/scene.hpp"
#include "process/process_test.hpp"
#include "support/channel_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace subworld::test {
namespace {

class Import : public ProcessTest {
 protected:
  /// The scene of a text; `remarks` gets what is said of it.
  Scene imported(const std::string& name, const std::string& text, const std::vector<std::string>& more = {}) {
    const std::string from = folder_.write(name, text), to = folder_.path() + "/made/scene.yaml";
    std::vector<std::string> words{program("subworld"), "import", from, "--out", to};
    words.insert(words.end(), more.begin(), more.end());
    ended_ = finish(words);
    EXPECT_EQ(ended_.code, 0) << ended_.err;
    return ended_.code == 0 ? load_scene(to) : Scene{};
  }
  static const Body& body(const Scene& scene, const std::string& name) {
    const auto at = std::ranges::find(scene.bodies, name, &Body::name);
    EXPECT_NE(at, scene.bodies.end()) << name;
    return *at;
  }
  Ended ended_;
};

TEST_F(Import, AWorldInSdformatKeepsItsMassesPlacesAndJoints) {
  const Scene scene = imported("world.sdf", R"(<?xml version="1.0"?>
<sdf version="1.7"><world name="gate_world"><gravity>0 0 -9.8</gravity>
<light type="directional" name="sun"/>
<model name="ground"><static>true</static><link name="link"><collision name="c">
<geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model>
<model name="gate"><pose>1 0 0 0 0 1.5707963267948966</pose>
<link name="post"><pose>0 0 0.5 0 0 0</pose><inertial><mass>5</mass><inertia><ixx>0.4</ixx><iyy>0.4</iyy><izz>0.02</izz></inertia></inertial>
<collision name="c"><geometry><cylinder><radius>0.05</radius><length>1</length></cylinder></geometry></collision></link>
<link name="wing"><pose>0.5 0 0.5 0 0 0</pose><inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass><inertia><ixx>0.05</ixx><iyy>0.3</iyy><izz>0.3</izz><ixy>0.01</ixy></inertia></inertial>
<collision name="c"><geometry><box><size>0.8 0.04 0.6</size></box></geometry><surface><friction><ode><mu>0.3</mu></ode></friction></surface></collision>
<visual name="v"><geometry><box><size>1 1 1</size></box></geometry></visual></link>
<joint name="hinge" type="revolute"><parent>post</parent><child>wing</child><pose relative_to="post">0.06 0 0 0 0 0</pose>
<axis><xyz>0 0 1</xyz><limit><lower>-0.5</lower><upper>1.5</upper></limit><dynamics><damping>0.2</damping><friction>0.1</friction></dynamics></axis></joint>
</model></world></sdf>)");
  EXPECT_NE(ended_.err.find("world.sdf:3: light sun is omitted"), std::string::npos) << ended_.err;
  EXPECT_NE(ended_.err.find("1 visuals are omitted"), std::string::npos) << ended_.err;
  EXPECT_EQ(scene.settings.world.gravity.z(), -9.8);
  const Body& wing = body(scene, "gate.wing");
  EXPECT_NEAR(wing.mass, 2.0, 1e-9);
  EXPECT_NEAR(wing.inertia.sum(), 0.65, 1e-9);
  EXPECT_NEAR(wing.inertia.prod(), 0.3 * (0.05 * 0.3 - 0.01 * 0.01), 1e-9);
  const BodyState& at = scene.initial[index(wing.id)];
  EXPECT_LT((at.position - Vec3(1, 0.6, 0.5)).norm(), 1e-9);  // of the centre of mass; the gate is turned
  EXPECT_EQ(wing.group, body(scene, "gate.post").group);
  ASSERT_EQ(scene.joints.size(), 1U);
  const Joint& hinge = scene.joints[0];
  EXPECT_EQ(hinge.kind, JointKind::hinge);
  EXPECT_NEAR(hinge.axes[5].lower, -0.5, 1e-9);
  EXPECT_EQ(hinge.axes[5].damping, 0.2);
  const JointPlace place = place_of(hinge, pose_of(at), pose_of(scene.initial[index(hinge.b)]));
  EXPECT_LT((place.point - Vec3(1, 0.06, 0.5)).norm(), 1e-9);
  EXPECT_EQ(scene.users.size(), 1U);
  EXPECT_EQ(run(folder_.path() + "/made/scene.yaml", {"--duration", "0.2"}).code, 0);
}

TEST_F(Import, ARobotInUrdfIsJoinedToTheWorld) {
  const Scene scene = imported("arm.urdf", R"(<robot name="arm"><link name="world"/>
<link name="upper"><inertial><origin xyz="0 0 -0.2"/><mass value="1.5"/><inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.2"/><geometry><box size="0.05 0.05 0.4"/></geometry></collision></link>
<link name="lower"><inertial><mass value="0.5"/><inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="wrist" type="revolute"><parent link="lower"/><child link="tool"/><axis xyz="0 0 1"/><limit lower="-6" upper="6" effort="0" velocity="1"/></joint>
<joint name="shoulder" type="continuous"><parent link="world"/><child link="upper"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.4"/><axis xyz="0 0 1"/><limit lower="-0.1" upper="0" effort="3" velocity="1"/></joint>
</robot>)");
  ASSERT_EQ(scene.joints.size(), 3U);
  const auto joint = [&](const std::string& name) {
    return *std::ranges::find(scene.joints, "arm." + name, &Joint::name);
  };
  EXPECT_TRUE(scene.body(joint("shoulder").b).fixed());
  EXPECT_EQ(joint("elbow").kind, JointKind::slider);
  EXPECT_NEAR(joint("elbow").axes[2].lower, -0.1, 1e-9);
  EXPECT_TRUE(std::isinf(joint("wrist").axes[5].upper));
  EXPECT_NE(ended_.err.find("arm.wrist: limits beyond 180 degrees are omitted"), std::string::npos) << ended_.err;
  EXPECT_NE(ended_.err.find("arm.lower: has no collision shape"), std::string::npos) << ended_.err;
  EXPECT_NEAR(scene.initial[index(body(scene, "arm.upper").id)].position.z(), 0.8, 1e-9);
}

TEST_F(Import, AModelInMjcfKeepsItsDefaultsAndSeveralJointsOfABody) {
  const Scene scene = imported("cart.xml", R"(<mujoco model="cart"><default><geom density="500"/></default>
<asset><mesh name="wedge" vertex="0 0 0 0.2 0 0 0 0.2 0 0 0 0.2"/></asset>
<worldbody><geom type="plane" size="1 1 1"/><light pos="0 0 3"/>
<body name="table" pos="0 0 0.2"><joint name="x" type="slide" axis="1 0 0" damping="0.5"/><joint name="y" type="slide" axis="0 1 0"/>
<joint name="turn" type="hinge" axis="0 0 1" frictionloss="0.2"/><geom type="box" size="0.2 0.2 0.05"/>
<body name="pole" pos="0 0 0.05"><joint name="tilt" type="hinge" axis="0 1 0" limited="true" range="-90 30"/><geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.02"/></body></body>
<body name="loose" pos="1 0 0.5"><freejoint/><geom type="mesh" mesh="wedge"/></body>
</worldbody><actuator><motor name="push" joint="x"/></actuator></mujoco>)");
  EXPECT_NE(ended_.err.find("actuator push is omitted"), std::string::npos) << ended_.err;
  ASSERT_EQ(scene.joints.size(), 2U);
  const Joint& six = scene.joints[0];
  EXPECT_EQ(six.kind, JointKind::six);
  EXPECT_TRUE(six.axes[0].free && six.axes[1].free && six.axes[5].free);
  EXPECT_EQ(six.axes[0].damping, 0.5);
  EXPECT_EQ(six.axes[5].friction, 0.2);
  EXPECT_NEAR(body(scene, "table").mass, 500 * 0.4 * 0.4 * 0.1, 1e-9);
  EXPECT_NEAR(scene.joints[1].axes[5].lower, -M_PI / 2, 1e-9);
  EXPECT_GT(body(scene, "loose").mass, 500 * 0.008 / 6.0 - 1e-6);  // MuJoCo 2.2 counts more than the volume of a mesh
  EXPECT_TRUE(std::filesystem::exists(folder_.path() + "/made/meshes/wedge.obj"));
  EXPECT_EQ(run(folder_.path() + "/made/scene.yaml", {"--duration", "0.2"}).code, 0);
}

TEST_F(Import, AConcaveMeshThatMovesKeepsItsOpening) {
  const auto robot = [](const std::string& mesh, const std::string& more = "") {
    return R"(<robot name="r"><link name="u"><inertial><origin xyz="0 0.02 0.05"/><mass value="3"/>
<inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><geometry><mesh filename=")" +
           mesh + R"("/></geometry></collision>)" + more + "</link></robot>";
  };
  folder_.write("u.obj", kChannel);
  const Scene scene = imported("channel.urdf", robot("u.obj"), {"--strict"});
  EXPECT_EQ(ended_.err, "");
  ASSERT_EQ(scene.divided.size(), 1U);
  EXPECT_EQ(scene.divided[0].parts, 3U);
  const Body& u = body(scene, "r.u");
  EXPECT_EQ(u.mass, 3.0);
  const BodyState& at = scene.initial[index(u.id)];
  EXPECT_LT((at.position - Vec3(0, 0.02, 0.05)).norm(), 1e-9);
  const Eigen::Matrix3d axes = at.orientation.toRotationMatrix();
  const Eigen::Matrix3d inertia = axes * u.inertia.asDiagonal() * axes.transpose();
  EXPECT_LT((inertia - Eigen::Matrix3d(Vec3(1, 2, 2.5).asDiagonal())).norm(), 1e-9) << inertia;
  const Mesh& mesh = scene.meshes[u.shape.mesh];
  for (const Vec3& v : mesh.vertices) {
    const Vec3 in_link = at.position + at.orientation * v;  // turned and moved by the origin of the collision
    EXPECT_TRUE(in_link.x() > 0.04 - 1e-6 && in_link.x() < 0.1 + 1e-6 && std::abs(in_link.y()) < 0.05 + 1e-6)
        << in_link.transpose();
  }
  EXPECT_EQ(run(folder_.path() + "/made/scene.yaml", {"--duration", "0.2"}).code, 0);
  folder_.write("wedge.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT_TRUE(imported("wedge.urdf", robot("wedge.obj"), {"--strict"}).divided.empty()) << "it is its own hull";
  const std::string channel = kChannel;
  folder_.write("open.obj", channel.substr(0, channel.find_last_of('f')));
  EXPECT_TRUE(imported("open.urdf", robot("open.obj")).divided.empty());
  EXPECT_NE(ended_.err.find("is not closed"), std::string::npos) << ended_.err;
  EXPECT_NE(ended_.err.find("so the convex hull collides"), std::string::npos) << ended_.err;
  (void)imported("both.urdf", robot("u.obj", "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"));
  EXPECT_NE(ended_.err.find("beside other shapes of its link, so the convex hull collides"), std::string::npos);
}

TEST_F(Import, RollingFrictionOfAModelInMjcfIsThatOfItsContacts) {
  const Scene scene = imported("balls.xml", R"(<mujoco model="balls"><worldbody>
<geom type="plane" size="1 1 1" friction="1 0.007 0.0001"/>
<body name="coin" pos="0 0 0.1"><freejoint/><geom type="cylinder" size="0.1 0.01" condim="4" friction="0.8 0.006 0.5"/></body>
<body name="ball" pos="1 0 0.1"><freejoint/><geom type="sphere" size="0.1" condim="6" friction="0.8 0.009 0.002"/></body>
<body name="cube" pos="2 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" friction="0.8 0.003 0.001"/></body>
</worldbody></mujoco>)",
                               {"--strict"});
  const auto between = [&](const std::string& a, const std::string& b) {
    return in_contact(body(scene, a).material, body(scene, b).material, scene.settings.world.pairs);
  };
  // The larger of both, in metres, as far as the contact has the directions for it.
  EXPECT_EQ(between("ball", "world_2").rolling_friction, 0.002);
  EXPECT_EQ(between("ball", "world_2").spinning_friction, 0.009);
  EXPECT_EQ(between("ball", "ball").rolling_friction, 0.002);
  EXPECT_EQ(between("coin", "world_2").rolling_friction, 0.0);
  EXPECT_EQ(between("coin", "world_2").spinning_friction, 0.007);
  EXPECT_EQ(between("coin", "ball").rolling_friction, 0.5);
  EXPECT_EQ(between("cube", "world_2").rolling_friction, 0.0);
  EXPECT_EQ(between("cube", "world_2").spinning_friction, 0.0);
  EXPECT_EQ(run(folder_.path() + "/made/scene.yaml", {"--duration", "0.2"}).code, 0);
}

// The places after a second are MuJoCo 2.2.2's own, by RK4 in steps of 0.1 ms.
TEST_F(Import, AModelMovesAsInItsOwnEngine) {
  const Scene scene = imported("falling.xml", R"(<mujoco model="falling"><worldbody>
<body name="upper" pos="0 0 2"><joint name="a" type="hinge" axis="0 1 0" damping="0.01"/><geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.02" density="1000"/>
<body name="lower" pos="0.5 0 0"><joint name="b" type="hinge" axis="0 0.6 0.8" stiffness="0.2" damping="0.01"/><geom type="box" pos="0.2 0 0" size="0.18 0.03 0.01" density="700"/>
<body name="ball" pos="0.4 0 0"><joint name="c" type="ball" damping="0.002"/><geom type="sphere" pos="0.1 0 0" size="0.03" density="2000"/></body></body></body>
<body name="cart" pos="0 2 1"><joint name="x" type="slide" axis="1 0 0" damping="0.5"/><geom type="box" size="0.1 0.1 0.05" density="300"/>
<body name="pole" pos="0 0 0.1"><joint name="t" type="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0.4" size="0.02" density="500"/></body></body>
</worldbody></mujoco>)");
  EXPECT_EQ(ended_.err, "");
  ASSERT_EQ(run(folder_.path() + "/made/scene.yaml",
                {"--duration", "1", "--set", "settle.duration_s=0", "--set", "world.preset=quality", "--bodies", "all"})
                .code,
            0);
  const std::string table = read_text(out() + "/bodies.csv");
  for (const auto& [name, place] : {std::pair("upper", Vec3(-0.248735, 0.0, 1.974879)),
                                    {"lower", Vec3(-0.692084, 0.044061, 1.963316)},
                                    {"ball", Vec3(-0.981702, 0.089627, 2.008053)},
                                    {"cart", Vec3(0.058862, 2.0, 1.0)},
                                    {"pole", Vec3(-0.112856, 2.0, 1.281695)}}) {
    const std::size_t row = table.rfind(std::string(",") + name + ",");
    ASSERT_NE(row, std::string::npos) << name;
    Vec3 at;
    ASSERT_EQ(std::sscanf(table.c_str() + row + std::string(name).size() + 2, "%lf,%lf,%lf", &at.x(), &at.y(), &at.z()),
              3);
    EXPECT_LT((at - place).norm(), 5e-5) << name;
  }
}

TEST_F(Import, StrictRefusesWhatHasNoCounterpartAndErrorsNameTheLine) {
  const std::string to = folder_.path() + "/scene.yaml";
  const auto refused = [&](const std::string& name, const std::string& text, const std::string& message,
                           const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{program("subworld"), "import", folder_.write(name, text), "--out", to};
    words.insert(words.end(), more.begin(), more.end());
    const Ended ended = finish(words);
    EXPECT_EQ(ended.code, 2) << name;
    EXPECT_NE(ended.err.find(message), std::string::npos) << ended.err;
    EXPECT_FALSE(std::filesystem::exists(to));
  };
  refused("a.sdf", "<sdf version='1.7'><world name='w'>\n<light name='l' type='point'/></world></sdf>",
          "1 things have no counterpart (--strict)", {"--strict"});
  folder_.write("scene.yaml", "an earlier one");
  const Ended again = finish({program("subworld"), "import", folder_.path() + "/a.sdf", "--out", to, "--strict"});
  EXPECT_EQ(again.code, 2);
  EXPECT_EQ(read_text(to), "an earlier one");
  std::filesystem::remove(to);
  refused("b.sdf",
          "<sdf version='1.7'><model name='m'>\n<link name='l'/><joint name='j' type='fixed'><parent>l</parent>"
          "<child>k</child></joint></model></sdf>",
          "b.sdf:");
  refused("c.xml", "<mujoco><worldbody>\n<body><geom type='bxo'/></body></worldbody></mujoco>", "c.xml:");
  refused("d.sdf", "no xml at all", "d.sdf");
  refused("e.urdf", "<robot name='r'>\n<link name='u'></lnik>\n</robot>",
          "e.urdf:2: cannot be parsed: xml error mismatched element; is the file complete?");
  refused("f.urdf", "<robot name='r'><link name='a'/><link name='b'/></robot>",
          "f.urdf: Failed to find root link: Two root links found: [a] and [b]");
  refused("g.urdf", "", "g.urdf: cannot be parsed: xml error empty document");
}

}  // namespace
}  // namespace subworld::test
