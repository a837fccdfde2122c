#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"
#include "lab/report/html.hpp"
#include "lab/report/plot.hpp"

namespace harco::lab {
namespace {

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// 640 x 300 with margins 64, 16, 44, 46: the frame spans x 64 … 624 and y 254 … 44.
Plot plot_of(Mark mark) {
  Plot plot;
  plot.x_range = {0.0, 10.0};
  plot.y_range = {0.0, 2.0};
  plot.series = {{"a < b", "#123456", mark, {0.0, 5.0, 10.0}, {0.0, 1.0, 2.0}}};
  return plot;
}

TEST(Plot, PutsPointsWhereTheyBelong) {
  EXPECT_TRUE(has(draw(plot_of(Mark::line)), "M64.0 254.0L344.0 149.0L624.0 44.0"));
  EXPECT_TRUE(has(draw(plot_of(Mark::steps)), "M64.0 254.0H344.0V149.0H624.0V44.0"));
  EXPECT_TRUE(has(draw(plot_of(Mark::dots)), "cx=\"344.0\" cy=\"149.0\""));
  EXPECT_TRUE(has(draw(plot_of(Mark::bars)), "y=\"149.0\" width=\"20.0\" height=\"105.0\""));
}

TEST(Plot, LogarithmicAxesPutDecadesApartEvenly) {
  Plot plot = plot_of(Mark::line);
  plot.log_x = plot.log_y = true;
  plot.x_range = plot.y_range = {0.01, 100.0};
  plot.series[0].x = {0.01, 1.0, 100.0};
  plot.series[0].y = {100.0, 1.0, 0.01};
  EXPECT_TRUE(has(draw(plot), "M64.0 44.0L344.0 149.0L624.0 254.0"));
  plot.x_range = {0.0, 1.0};
  EXPECT_THROW(draw(plot), std::invalid_argument);
}

TEST(Plot, ValuesThatAreNotFiniteLeaveAGap) {
  Plot plot = plot_of(Mark::line);
  plot.series[0].x = {0.0, 5.0, 10.0};
  plot.series[0].y = {0.0, std::numeric_limits<double>::quiet_NaN(), 2.0};
  EXPECT_TRUE(has(draw(plot), "M64.0 254.0M624.0 44.0"));
}

TEST(Plot, WordsAreEscaped) {
  EXPECT_TRUE(has(draw(plot_of(Mark::line)), "a &lt; b"));
  EXPECT_FALSE(has(draw(plot_of(Mark::line)), "a < b"));
}

TEST(Plot, RefusesSeriesOfUnequalLength) {
  Plot plot = plot_of(Mark::line);
  plot.series[0].y.pop_back();
  EXPECT_THROW(draw(plot), std::invalid_argument);
}

TEST(Plot, AGridHoldsAllItsPlots) {
  const std::string svg = draw_grid(std::vector<Plot>(3, plot_of(Mark::line)), 2);
  EXPECT_TRUE(has(svg, "width=\"1280\" height=\"600\""));
  EXPECT_TRUE(has(svg, "translate(640 0)"));
  EXPECT_TRUE(has(svg, "translate(0 300)"));
}

TEST(Html, SummarisesFindings) {
  Report report;
  report.title = "T";
  Finding good{"lost", "1 %", "0 %", "5 %", "none", true};
  Finding bad{"error", "", "3", "", "2", false};
  report.sections.push_back({"4.1", "Title & more", "", {{good, bad}, {Paragraph{"x < y"}}}});
  const std::string html = format_html(report);
  EXPECT_TRUE(has(html,
                  "<td>lost</td><td>1 %</td><td>0 %</td><td>5 %</td><td>none</td>"
                  "<td class=\"yes\">reached</td>"));
  EXPECT_TRUE(has(html, "<td class=\"no\">missed</td>"));
  EXPECT_TRUE(has(html, "Title &amp; more"));
  EXPECT_TRUE(has(html, "x &lt; y"));
}

TEST(Html, OverviewHasAPlotOfEachChapterThatHasOne) {
  Report report;
  report.sections.resize(3);
  EXPECT_EQ(format_overview(report), "");
  report.sections[0].chapter.overview = plot_of(Mark::line);
  report.sections[2].chapter.overview = plot_of(Mark::dots);
  report.sections[2].name = "4.6";
  report.sections[2].chapter.overview->title = "Deck";
  const std::string svg = format_overview(report);
  EXPECT_TRUE(has(svg, "4.6 Deck"));
  EXPECT_TRUE(has(svg, "translate(560 0)"));
  EXPECT_FALSE(has(svg, "translate(0 270)"));
}

TEST(Picture, IsAJpegOfTheWidthAskedFor) {
  const Image image(64, 32, 100);
  const Picture picture = picture_of(image.view(), "label", {}, 32);
  EXPECT_EQ(picture.jpeg_base64.substr(0, 4), "/9j/");  // FF D8 FF
  EXPECT_EQ(picture.jpeg_base64.size() % 4, 0U);
  const Picture again = picture_from(to_json(picture));
  EXPECT_EQ(again.label, "label");
  EXPECT_EQ(again.jpeg_base64, picture.jpeg_base64);
}

TEST(Setup, PoseErrorIsSeenInTheCamera) {
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  truth.linear() = Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  truth.translation() = Eigen::Vector3d(1.0, 2.0, 3.0);
  Eigen::Isometry3d estimate = truth;
  estimate.linear() = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) * truth.linear();
  estimate.translation() += Eigen::Vector3d(0.01, 0.02, -0.03);
  const Vector6d error = pose_error(estimate, truth);
  EXPECT_TRUE(error.isApprox((Vector6d() << 0.01, 0.02, -0.03, 0.1, 0.0, 0.0).finished(), 1e-9));
}

TEST(Setup, CoordinatesTurnAboutXThenYThenZ) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  const Vector6d all = coordinates(pose);
  EXPECT_TRUE(all.tail<3>().isApprox(Eigen::Vector3d(0.1, 0.2, 0.3), 1e-12));
}

TEST(Setup, NumbersSurviveJson) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Json json = to_json(std::vector<double>{1.0 / 3.0, nan, -2.5e-7});
  EXPECT_EQ(json.dump(), "[0.33333,null,-2.5e-07]");
  const std::vector<double> back = numbers(json);
  EXPECT_EQ(back[0], 0.33333);
  EXPECT_TRUE(std::isnan(back[1]));
}

TEST(Setup, TextHasTheDigitsThatCount) {
  EXPECT_EQ(text(0.65), "0.650");
  EXPECT_EQ(text(12.345), "12.3");
  EXPECT_EQ(text(1234.5), "1234");
  EXPECT_EQ(text(0.000123456), "0.000123");
  EXPECT_EQ(text(std::nan("")), "-");
  EXPECT_EQ(percent(1, 4), "25 %");
  EXPECT_EQ(percent(0, 0), "-");
}

TEST(Setup, RootMeanSquareOfNothingIsNotANumber) {
  RootMeanSquare rms;
  EXPECT_TRUE(std::isnan(rms.value()));
  rms.add(3.0);
  rms.add(-4.0);
  EXPECT_DOUBLE_EQ(rms.value(), std::sqrt(12.5));
}

TEST(Setup, ItemsHaveNumbersOfTheirOwn) {
  EXPECT_EQ(generator("4.1", 3)(), generator("4.1", 3)());
  EXPECT_NE(generator("4.1", 3)(), generator("4.1", 4)());
  EXPECT_NE(generator("4.1", 3)(), generator("4.2", 3)());
}

TEST(Setup, WanderingStaysNearItsRange) {
  std::mt19937_64 random(5);
  const Wander wander(random, 0.1, 1.0);
  RootMeanSquare rms;
  for (int i = 0; i < 100000; ++i) {
    const double value = wander(0.01 * i);
    EXPECT_LE(std::abs(value), 1.6);  // all five sines at their top
    rms.add(value);
  }
  EXPECT_NEAR(rms.value(), 0.5, 0.05);
}

}  // namespace
}  // namespace harco::lab
