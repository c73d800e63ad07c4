// SPDX-License-Identifier: Apache-2.0
// Goal: a model of several files is read as one, and what is said of its lines names the files' own. Method: files
// written by the test, among them one that is missing, one that includes itself, and comments that say `<include`.
#include "config/model_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/files.hpp"

namespace takt::config {
namespace {

using testing::HasSubstr;

class ModelTextTest : public testing::Test {
 protected:
  ModelTextTest() { std::filesystem::create_directories(folder_ + "parts"); }
  ~ModelTextTest() override { std::filesystem::remove_all(folder_); }
  std::string put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ + name) << text;
    return folder_ + name;
  }
  const std::string folder_ = testing::TempDir() + "takt-model-text-" + std::to_string(getpid()) + "/";
};

TEST_F(ModelTextTest, AFileByItselfIsAsItIsWithoutComments) {
  const std::string path = put("a.xml", "<mujoco>\n<!-- <include file='no.xml'/>\n--> <body/>\n</mujoco>\n");
  const auto model = read_model_text(path);
  ASSERT_TRUE(model) << model.error();
  EXPECT_EQ(model->text, "<mujoco>\n" + std::string(29, ' ') + "\n    <body/>\n</mujoco>\n");
  EXPECT_EQ(model->files, std::vector<std::string>{path});
  EXPECT_EQ(in_lines_of_files(*model, "refused in line 4, as it is"), "refused in line 4, as it is");
  EXPECT_EQ(model_bytes(path).value(), test::text_of(path));
}

TEST_F(ModelTextTest, XacroIsNamedAsSuch) {
  const std::string path = put("r.xacro", "<robot xmlns:xacro='x'><xacro:property name='a' value='1'/></robot>");
  const auto model = read_model_text(path);
  ASSERT_FALSE(model);
  EXPECT_THAT(model.error(), HasSubstr(path + ": is xacro"));
  EXPECT_THAT(read_model_text(put("e.urdf", "<robot><limit effort=\"${e}\"/></robot>")).error(), HasSubstr("is xacro"));
  EXPECT_TRUE(read_model_text(put("r.urdf", "<robot xmlns:xacro='x'><!-- <xacro:a/> --><link name='a'/></robot>")))
      << "what xacro wrote";
}

TEST_F(ModelTextTest, WhatIsIncludedStandsWhereItIsIncluded) {
  put("robot.xml", "<mujoco model='r'>\n  <body/>\n  <include file=\"parts/leg.xml\"/>\n  <arm/>\n</mujoco>\n");
  const std::string leg = put("parts/leg.xml", "<mujocoinclude>\n<leg/></mujocoinclude>");
  const std::string scene = put("scene.xml", "<mujoco>\n<include\n file='robot.xml'/>\n<floor/>\n</mujoco>\n");
  const auto model = read_model_text(scene);
  ASSERT_TRUE(model) << model.error();
  EXPECT_EQ(model->text, "<mujoco>\n\n  <body/>\n  \n<leg/>\n  <arm/>\n\n<floor/>\n</mujoco>\n");
  EXPECT_EQ(model->files, (std::vector<std::string>{scene, folder_ + "robot.xml", leg}));
  EXPECT_EQ(in_lines_of_files(*model, "Line number=5: leg"), "Line number=2 of " + leg + ": leg");
  EXPECT_EQ(in_lines_of_files(*model, "in line 3"), "in line 2 of " + folder_ + "robot.xml");
  EXPECT_EQ(in_lines_of_files(*model, "in line 8"), "in line 4") << "behind it the scene goes on";
  const std::string before = model_bytes(scene).value();
  put("parts/leg.xml", "<mujocoinclude>\n<longer/></mujocoinclude>");
  EXPECT_NE(model_bytes(scene).value(), before);
}

TEST_F(ModelTextTest, WhatOnlyBeginsLikeAnIncludeStays) {
  const std::string text =
      "<mujoco>\n<include <b/>\n<include/><include file='a.xml'>x</include><includes file='b'/></mujoco>";
  const auto model = read_model_text(put("odd.xml", text));
  ASSERT_TRUE(model) << model.error();
  EXPECT_EQ(model->text, text);
  EXPECT_EQ(in_lines_of_files(*model, "Line 99999999999999999999, spline 2, line x, Line"),
            "Line 3, spline 2, line x, Line");
}

TEST_F(ModelTextTest, WhatCannotBeIncludedIsNamedWithItsLine) {
  const std::string lacks = put("lacks.xml", "<mujoco>\n\n<include file='none.xml'/></mujoco>");
  EXPECT_THAT(read_model_text(lacks).error(), HasSubstr("lacks.xml:3: includes none.xml, which cannot be read"));
  put("one.xml", "<mujoco>\n<include file='two.xml'/></mujoco>");
  const std::string loop = put("two.xml", "<mujoco><include file='one.xml'/></mujoco>");
  EXPECT_THAT(read_model_text(loop).error(), HasSubstr("one.xml:2: includes two.xml, which comes back to itself"));
  put("open.xml", "<mujoco><body>");
  EXPECT_THAT(read_model_text(put("uses.xml", "<mujoco><include file='open.xml'/></mujoco>")).error(),
              HasSubstr("does not end its <mujoco>"));
  EXPECT_THAT(read_model_text(folder_ + "nowhere.xml").error(), HasSubstr("nowhere.xml: cannot be read"));
}

}  // namespace
}  // namespace takt::config
