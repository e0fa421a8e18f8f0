#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/bids/bids_app.hpp"

int main(int argc, char** argv) {
  emmetrope::cohort::BidsOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"bids", "Measures a BIDS dataset as BIDS Apps do, into a BIDS dataset of derivatives.",
       "emmetrope bids dataset dataset/derivatives/emmetrope participant --participant-label 01",
       [&](CLI::App& app) {
         app.add_option("dataset", options.dataset, "BIDS dataset")->required()->type_name("BIDS_DIR");
         app.add_option("output", options.output, "Dataset of derivatives to make or add to")
             ->required()
             ->type_name("OUT");
         app.add_option("level", options.level,
                        "participant: measures; group: the table and the page of all in OUT")
             ->required()
             ->check(CLI::IsMember({"participant", "group"}))
             ->type_name("LEVEL");
         app.add_option("--participant-label,--participant_label", options.participants,
                        "Only these, with or without sub-")
             ->type_name("LABEL ...");
         app.add_option("--session-label,--session_label", options.sessions,
                        "Only these, with or without ses-")
             ->type_name("LABEL ...");
       },
       [&](const emmetrope::CommonOptions& common) { return emmetrope::cohort::run_bids(options, common); }});
}
