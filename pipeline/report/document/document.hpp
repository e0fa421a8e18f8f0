#pragma once
#include <string>
#include <variant>
#include <vector>

/// The report's content, once, for every medium: HTML and PDF are two renderings of one Document, so that
/// their numbers cannot differ. All text is plain UTF-8; renderers escape it.
namespace emmetrope::report {

/// A picture as a complete SVG document, with raster images inside as data URLs.
struct Figure {
  std::string id;  ///< [a-z0-9-], unique in the document
  std::string title;
  std::string caption;  ///< of this picture alone; may be empty
  std::string alt;      ///< for a reader who does not see it
  std::string svg;
  double width_px = 0, height_px = 0;  ///< of the SVG's viewBox
};

struct Paragraph {
  std::string text;
};

struct BulletList {
  std::vector<std::string> items;
  bool small = false;  ///< small print: references
};

/// The first cell of a row names it.
struct Table {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  bool folded = false;                  ///< shown on demand
  std::vector<std::string> links = {};  ///< where each row's name leads in HTML; empty: nowhere
};

/// Figures side by side.
struct FigureRow {
  std::vector<Figure> figures;
  std::string caption;  ///< what to look for, of all of them
  /// Slices in radiological convention, which the reader may switch.
  bool anatomical = false;
  std::string folded = {};  ///< shown on demand under these words
};

/// Lines on paper for those who review the report.
struct SignatureLines {
  std::vector<std::string> labels;
};

/// Shown on demand; HTML only.
struct Folded {
  std::string summary;
  std::string text;
};

enum class Light { green, amber, red };

/// What a card warns of, and what to do about it.
struct Finding {
  std::string what, to_do;
};

/// As many as a reader takes in; the rest is folded away, or in the page alone.
inline constexpr std::size_t most_findings = 5;

/// The answer for one eye.
struct EyeCard {
  std::string eye;  ///< "OD (right)"
  std::string id;   ///< "od"
  Light light = Light::red;
  std::string verdict;           ///< the light in words
  std::vector<Finding> reasons;  ///< the most dangerous first
  std::string headline;          ///< the answer with its uncertainty; empty when there is none
  std::string prescription;      ///< rounded, clinical notation; empty when there is none
  std::vector<std::pair<std::string, std::string>> facts;  ///< beside the verdict
  std::string next;                                        ///< what to do
  std::string note;                                        ///< of either: vertex distance, what it holds for
  Table details;                      ///< full precision with intervals; on demand, not on paper
  std::string before_png, after_png;  ///< bytes; empty when there are none
  std::string picture_caption;
};

struct EyeCards {
  std::vector<EyeCard> cards;
};

using Block = std::variant<Paragraph, BulletList, Table, FigureRow, Folded, EyeCards, SignatureLines>;

/// Whether a block stands in the PDF, which has few pages; room goes to `first_if_room` before `if_room`.
enum class Paper { always, first_if_room, if_room, never };

struct SectionBlock {
  Block block;
  Paper paper = Paper::always;
};

struct Section {
  std::string id;
  std::string title;
  std::vector<SectionBlock> blocks;
};

struct Document {
  std::string title;
  std::vector<std::pair<std::string, std::string>> heading;  ///< "Case", "Study date", ...
  std::vector<Section> sections;
  /// Of the study, "2026-03-14"; dates the PDF, so that the same case gives the same bytes
  std::string date_iso;
};

}  // namespace emmetrope::report
