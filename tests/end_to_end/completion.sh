#!/bin/sh
# bash, zsh and fish complete commands, options and choices from what is installed.
# Usage: completion.sh BUILD_FOLDER
set -eu
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cmake --install "$1" --prefix "$place" --component programs >/dev/null
cd "$place"

in_bash() {
  bash -c 'source share/bash-completion/completions/emmetrope
           read -ra COMP_WORDS <<<"$1"; case $1 in *" ") COMP_WORDS+=("") ;; esac
           COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _emmetrope; printf "%s\n" "${COMPREPLY[@]}"' bash "$1"
}
# What a terminal shows after the second tab.
in_zsh() {
  zsh -f -c 'zmodload zsh/zpty; zmodload zsh/zselect
             zpty shell zsh -f -i
             zpty -w shell "fpath=($PWD/share/zsh/vendor-completions \$fpath); autoload -Uz compinit; compinit -u -D
                            unsetopt list_ambiguous; LISTMAX=1000; stty cols 150 rows 200; PS1=ready"
             until [[ $shown == *ready* ]]; do zpty -r shell line && shown+=$line; done
             zpty -w -n shell "$1"$'"'\t\t'"'
             for wait in {1..20}; do
               zselect -t 10
               while zpty -r -t shell line; do print -r -- "$line"; done
             done
             zpty -d shell' zsh "$1" | sed 's/\x1b\[[0-9;?]*[a-zA-Z]//g' | tr '\r' '\n'
}
# shellcheck disable=SC2016  # fish's own variable
in_fish() { PATH="$PWD/bin:$PATH" XDG_DATA_DIRS="$PWD/share" HOME="$PWD" fish -c 'complete -C $argv[1]' "$1"; }

completes() { # LINE WORD: each shell offers the word
  for shell in bash zsh fish; do
    "in_$shell" "$1" >"$shell.offers" </dev/null
    grep -qE -- "(^|[^-a-z])$2( |	|$)" "$shell.offers" || { echo "$shell: after '$1' there is no '$2':"; cat "$shell.offers"; exit 1; }
  done
}
completes "emmetrope " segment
completes "emmetrope seg" segment
completes "emmetrope segment --" --laterality
completes "emmetrope trace --method " paper
echo "completion: bash, zsh and fish complete commands, options and choices"
