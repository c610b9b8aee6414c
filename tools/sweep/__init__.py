"""The modules of vox-sweep; README.md says which is what."""
