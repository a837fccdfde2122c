#include "lab/report/html.hpp"

#include <fmt/format.h>

#include "lab/report/xml.hpp"

namespace harco::lab {
namespace {

constexpr const char* kStyle = R"(
body { font: 15px/1.5 Helvetica, Arial, sans-serif; color: #222; max-width: 1320px;
       margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.7em; } h2 { font-size: 1.3em; margin-top: 2.4em; border-bottom: 2px solid #1f63b4; }
table { border-collapse: collapse; margin: 1em 0; } caption { text-align: left; color: #555;
        padding-bottom: .3em; caption-side: top; }
th, td { padding: .25em .8em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { background: #f2f5f9; } td.yes { color: #187a3c; font-weight: bold; }
td.no { color: #b3261e; font-weight: bold; }
figure { margin: 1.2em 0; } figcaption { color: #555; } svg { max-width: 100%; height: auto; }
div.strip { display: flex; flex-wrap: wrap; gap: 6px; } div.strip figure { margin: 0; }
div.strip figcaption { font-size: 12px; text-align: center; }
p.note { color: #777; } dl { display: grid; grid-template-columns: max-content auto; gap: 0 1em; }
dt { color: #777; } dd { margin: 0; }
)";

constexpr int kOverviewWidth = 560, kOverviewHeight = 270;

std::string cell(const std::string& text) { return fmt::format("<td>{}</td>", escaped(text)); }

std::string verdict(const Finding& finding) {
  if (!finding.reached) return "<td></td>";
  return *finding.reached ? R"(<td class="yes">reached</td>)" : R"(<td class="no">missed</td>)";
}

std::string head(const std::vector<std::string>& names) {
  std::string out = "<tr>";
  for (const std::string& name : names) out += fmt::format("<th>{}</th>", escaped(name));
  return out + "</tr>\n";
}

/// Rows of findings; with the section's number in front where it is given.
std::string rows_of(const Chapter& chapter, const std::string& section) {
  std::string out;
  for (const Finding& finding : chapter.findings) {
    out += "<tr>";
    if (!section.empty())
      out += fmt::format(R"(<td><a href="#s{0}">{0}</a></td>)", escaped(section));
    for (const std::string* text :
         {&finding.what, &finding.paper, &finding.ours, &finding.baseline, &finding.goal})
      out += cell(*text);
    out += verdict(finding) + "</tr>\n";
  }
  return out;
}

std::string format(const Paragraph& paragraph) {
  return fmt::format("<p>{}</p>\n", escaped(paragraph.text));
}

std::string format(const Table& table) {
  std::string out =
      fmt::format("<table><caption>{}</caption>\n{}", escaped(table.caption), head(table.head));
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (const std::string& text : row) out += cell(text);
    out += "</tr>\n";
  }
  return out + "</table>\n";
}

std::string format(const Figure& figure) {
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", figure.svg,
                     escaped(figure.caption));
}

std::string format(const Strip& strip) {
  std::string out = "<div class=\"strip\">\n";
  for (const Picture& picture : strip.pictures)
    out += fmt::format(
        R"(<figure><img alt="{0}" src="data:image/jpeg;base64,{1}"/><figcaption>{0}</figcaption></figure>)"
        "\n",
        escaped(picture.label), picture.jpeg_base64);
  return out + fmt::format("</div>\n<p>{}</p>\n", escaped(strip.caption));
}

std::string format(const ReportSection& section) {
  std::string out =
      fmt::format("<h2 id=\"s{0}\">{0} {1}</h2>\n", escaped(section.name), escaped(section.title));
  if (!section.note.empty())
    out += fmt::format("<p class=\"note\">{}</p>\n", escaped(section.note));
  for (const Block& block : section.chapter.blocks)
    out += std::visit([](const auto& one) { return format(one); }, block);
  return out;
}

}  // namespace

std::string format_overview(const Report& report) {
  std::vector<Plot> plots;
  for (const ReportSection& section : report.sections) {
    if (!section.chapter.overview) continue;
    plots.push_back(*section.chapter.overview);
    plots.back().title = section.name + " " + plots.back().title;
    plots.back().width = kOverviewWidth;
    plots.back().height = kOverviewHeight;
  }
  return plots.empty() ? "" : draw_grid(plots, 2) + "\n";
}

std::string format_html(const Report& report) {
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n<title>{0}</title>\n"
      "<style>{1}</style></head>\n<body>\n<h1>{0}</h1>\n<p>{2}</p>\n",
      escaped(report.title), kStyle, escaped(report.introduction));
  out += "<table><caption>Summary</caption>\n" +
         head({"section", "", "paper", "HArCo here", "baseline here", "goal", ""});
  for (const ReportSection& section : report.sections)
    out += rows_of(section.chapter, section.name);
  out += "</table>\n<figure>" + format_overview(report) + "</figure>\n";
  for (const ReportSection& section : report.sections) out += format(section);
  out += "<h2>Machine and version</h2>\n<dl>\n";
  for (const auto& [name, value] : report.facts)
    out += fmt::format("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value));
  return out + "</dl>\n</body></html>\n";
}

}  // namespace harco::lab
